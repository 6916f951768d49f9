// "measure": {"kind": "brdf", ...}: what parse_brdf.cpp reads, as a kind of measurement.
#include "server/canonical.h"
#include "server/job_sections.h"
#include "server/measure_kind.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

Prediction predict(const LoadedJob& job) {
    const auto& plan = std::get<BrdfPlan>(job.job.plan);
    return job.reference ? predict_reference(job.surface.surface, job.material, plan, *job.reference)
                         : predict_brdf(job.surface.surface, job.material, plan);
}

Report run(const LoadedJob& job, const std::vector<OutputRequest>& files, const RunOptions& options,
           const Monitor& monitor) {
    BrdfResult result = run_brdf(job, options, monitor);
    monitor.check_cancelled();
    write_outputs(job, result, files);
    return std::move(result.report);
}

}  // namespace

MeasureKind brdf_kind() {
    return {"brdf",
            "table",
            table_formats(),
            [](const JsonNode& measure, const Accuracy& accuracy) -> MeasurePlan {
                return parse_brdf(measure, accuracy);
            },
            [](const MeasurePlan& plan) { return canonical(std::get<BrdfPlan>(plan)); },
            predict,
            run};
}

}  // namespace gonio
