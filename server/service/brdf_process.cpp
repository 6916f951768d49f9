// Processes "brdf" and "reference": the job document of the command line, by the fast engine or by the path
// tracer that judges it.
#include <filesystem>

#include "server/executor/dispatch.h"
#include "server/json_node.h"
#include "server/result_json.h"
#include "server/service/processes.h"
#include "server/service/temporary_folder.h"
#include "server/service/uploads.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

using nlohmann::json;

constexpr OutputFormat table_outputs[] = {
    {"csv", "text/csv"}, {"json", "application/json"}, {"exr", "image/x-exr"}};

constexpr OutputFormat projection_outputs[] = {{"csv", "text/csv"},
                                               {"json", "application/json"},
                                               {"npy", "application/octet-stream"},
                                               {"exr", "image/x-exr"}};

std::vector<ProcessOutput> brdf_outputs() {
    return {
        {"table", "values, standard errors and biases", {std::begin(table_outputs), std::end(table_outputs)}},
        {"projection",
         "coefficients of spherical harmonics, of jobs whose measure has a member project",
         {std::begin(projection_outputs), std::end(projection_outputs)}},
        {"report",
         "what was chosen, skipped, counted, and how long it took",
         {{"json", "application/json"}}}};
}

// The table in every format, its projection if the job asks for one, and the report.
std::vector<NewOutput> make_outputs(Objects& objects, const LoadedJob& loaded, BrdfResult& result) {
    std::vector<NewOutput> outputs;
    const TemporaryFolder folder;
    for (const OutputFormat& format : table_outputs) {
        const std::string name = std::string("table.") + format.suffix,
                          path = (folder.path() / name).string();
        write_table(result.table, format.suffix, path);
        outputs.push_back({name, format.media_type, objects.put_file(path)});
    }
    if (std::get<BrdfPlan>(loaded.job.plan).project) {
        std::vector<OutputRequest> files;
        for (const OutputFormat& format : projection_outputs)
            files.push_back(
                {format.suffix, (folder.path() / (std::string("projection.") + format.suffix)).string()});
        write_outputs(loaded, result, files);
        for (size_t k = 0; k < files.size(); ++k)
            outputs.push_back({"projection." + files[k].format, projection_outputs[k].media_type,
                               objects.put_file(files[k].path)});
    }
    outputs.push_back(
        {"report.json", "application/json", objects.put(result_json(loaded, result.report, {}, {}))});
    return outputs;
}

// Here, or shard by shard on other machines: the same bits.
BrdfResult compute(const LoadedJob& loaded, const std::string& document, const Workplace& place) {
    if (!place.executor || !can_be_dispatched(loaded)) return run_brdf(loaded, place.options, place.monitor);
    const JobFolder folder(place.shared_folder, loaded, document, "/", place.shard_command, place.options);
    BrdfResult result = dispatch(loaded, folder, *place.executor, place.options, place.monitor, place.ending);
    std::error_code ignored;  // costs room, no correctness
    std::filesystem::remove_all(folder.job(), ignored);
    return result;
}

PreparedJob prepare(json document, std::optional<ReferenceOptions> reference, Objects& objects) {
    const UploadedFiles files = resolve_uploads(document, objects);
    const std::string text = files.document.dump();
    Job job = parse_job(text, {});
    require_kind(job, "brdf");
    read_as_untrusted(job);
    const auto loaded = std::make_shared<const LoadedJob>(load_job(job, reference));
    const auto& plan = std::get<BrdfPlan>(loaded->job.plan);
    PreparedJob prepared;
    prepared.job_hash = loaded->hash;
    prepared.runs_hash = loaded->runs_hash;
    prepared.surfaces = files.surfaces;
    if (reference) {
        prepared.prediction = predict_reference(loaded->surface.surface, loaded->material, plan, *reference);
    } else {
        prepared.prediction = predict_brdf(loaded->surface.surface, loaded->material, plan);
        prepared.target = plan.accuracy.target();
        prepared.at_target = [loaded](double target) {
            BrdfPlan coarser = std::get<BrdfPlan>(loaded->job.plan);
            coarser.accuracy = {target, {}, {}, coarser.accuracy.seed};
            return predict_brdf(loaded->surface.surface, loaded->material, coarser);
        };
    }
    prepared.run = [loaded, text](const Workplace& place) {
        BrdfResult result = compute(*loaded, text, place);
        place.monitor.check_cancelled();
        return make_outputs(place.objects, *loaded, result);
    };
    return prepared;
}

}  // namespace

ServiceProcess brdf_process() {
    return {"brdf",
            "BRDF of a height field",
            "Shadowing, masking and every order of diffuse scattering, each value with its standard error "
            "and bias.",
            {"surface", "base", "material", "measure", "accuracy"},
            {"surface", "material", "measure"},
            json::object(),
            brdf_outputs(),
            [](const json& document, Objects& objects) { return prepare(document, std::nullopt, objects); }};
}

ServiceProcess reference_process() {
    return {"reference",
            "The same by path tracing",
            "An unbiased path tracer that shares no code with process brdf: slow, to judge it by.",
            {"surface", "material", "measure", "accuracy", "reference"},
            {"surface", "material", "measure", "reference"},
            {{"reference",
              {{"type", "object"},
               {"required", {"paths"}},
               {"additionalProperties", false},
               {"properties", {{"paths", {{"type", "integer"}, {"minimum", 1}, {"maximum", 1 << 30}}}}}}}},
            brdf_outputs(),
            [](const json& document, Objects& objects) {
                const JsonNode root(document), traced = root.at("reference");
                traced.allow_keys({"paths"});
                const ReferenceOptions options{
                    static_cast<long long>(traced.at("paths").whole_number(1, 1 << 30))};
                json rest = document;
                rest.erase("reference");
                return prepare(std::move(rest), options, objects);
            }};
}

}  // namespace gonio
