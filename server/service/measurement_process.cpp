// The process of a kind of measurement (server/measure_kind.h) that writes its product itself.
#include <vector>

#include "server/measure_kind.h"
#include "server/result_json.h"
#include "server/service/processes.h"
#include "server/service/temporary_folder.h"
#include "server/service/uploads.h"

namespace gonio {
namespace {

using nlohmann::json;

PreparedJob prepare(const json& document, const ServiceProcess& process, Objects& objects) {
    const UploadedFiles files = resolve_uploads(document, objects);
    Job job = parse_job(files.document.dump(), {});
    require_kind(job, process.id);
    read_as_untrusted(job);
    const auto loaded = std::make_shared<const LoadedJob>(load_job(job));
    PreparedJob prepared;
    prepared.job_hash = loaded->hash;
    prepared.surfaces = files.surfaces;
    const MeasureKind& kind = kind_of(loaded->job.plan);
    prepared.prediction = kind.predict(*loaded);
    ProcessOutput served = process.outputs.front();
    if (kind.is_served)
        std::erase_if(served.formats,
                      [&](const OutputFormat& format) { return !kind.is_served(*loaded, format.suffix); });
    prepared.run = [loaded, product = std::move(served)](const Workplace& place) {
        const TemporaryFolder folder;
        std::vector<OutputRequest> requests;
        for (const OutputFormat& format : product.formats)
            requests.push_back(
                {format.suffix, (folder.path() / (product.name + "." + format.suffix)).string()});
        RunOptions options = place.options;
        options.checkpoints = nullptr;
        const Report report = run_job(*loaded, requests, options, place.monitor);
        place.monitor.check_cancelled();
        std::vector<NewOutput> outputs;
        for (size_t i = 0; i < requests.size(); ++i)
            outputs.push_back({product.name + "." + product.formats[i].suffix, product.formats[i].media_type,
                               place.objects.put_file(requests[i].path)});
        outputs.push_back(
            {"report.json", "application/json", place.objects.put(result_json(*loaded, report, {}, {}))});
        return outputs;
    };
    return prepared;
}

}  // namespace

void require_kind(const Job& job, const std::string& process) {
    if (const std::string& kind = kind_of(job.plan).name; kind != process)
        throw Error(ErrorCode::invalid_input, "/measure/kind", kind,
                    "must be \"" + process + "\" here: there is a process for every kind");
}

ServiceProcess measurement_process(const MeasureKind& kind, const std::string& title,
                                   const std::string& description, const std::string& product,
                                   std::vector<OutputFormat> formats) {
    ServiceProcess process{kind.name,
                           title,
                           description,
                           {"surface", "base", "material", "measure", "accuracy"},
                           {"surface", "material", "measure"},
                           json::object(),
                           {{kind.output, product, std::move(formats)},
                            {"report",
                             "what was chosen, skipped, counted, and how long it took",
                             {{"json", "application/json"}}}},
                           {}};
    process.prepare = [process](const json& document, Objects& objects) {
        return prepare(document, process, objects);
    };
    if (kind.light != MeasureKind::Light::directions)
        process.inputs.insert(process.inputs.begin() + 3, "environment");
    if (kind.light == MeasureKind::Light::environment)
        process.required.insert(process.required.begin() + 2, "environment");
    return process;
}

}  // namespace gonio
