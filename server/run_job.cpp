#include "server/run_job.h"

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/sha256.h"
#include "server/job_hash.h"
#include "server/measure_kind.h"
#include "server/projection_file.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

// Not the file's name: jobs of equal hash must have equal tables, whatever the file was called.
std::string size_of(const HeightField& surface) {
    char text[120];
    std::snprintf(text, sizeof text, "%d x %d points, pitch %.9g x %.9g m", surface.nx, surface.ny,
                  surface.pitch_x, surface.pitch_y);
    return text;
}

void make_folder_of(const std::string& path) {
    const auto folder = std::filesystem::path(path).parent_path();
    if (folder.empty()) return;
    std::error_code failure;
    std::filesystem::create_directories(folder, failure);
    if (failure) throw Error(ErrorCode::io, folder.string(), "", "cannot be made: " + failure.message());
}

}  // namespace

LoadedJob load_job(const Job& job, const std::optional<ReferenceOptions>& reference) {
    if (reference && !std::holds_alternative<BrdfPlan>(job.plan))
        throw Error(ErrorCode::invalid_input, "/measure/kind", kind_of(job.plan).name,
                    "the path tracer measures brdf jobs only");
    if (job.base.is_curved() && job.environment)
        throw Error(ErrorCode::invalid_input, "/base", "",
                    "an environment lights flat bases only; \"brdf\", \"btf\" and \"maps\" know curved ones");
    LoadedJob loaded{job, load_surface(job.surface, job.base), {}, reference};
    loaded.material = load_material(job.material, job.surface, loaded.surface);
    const ReferenceOptions* options = reference ? &*reference : nullptr;
    loaded.hash = job_hash(loaded.surface.hash, loaded.material, job.plan, options);
    loaded.runs_hash = runs_hash(loaded.surface.hash, loaded.material, job.plan, options);
    if (job.environment) {
        loaded.environment = load_environment(*job.environment);
        const std::string key = environment_hash(*loaded.environment);
        loaded.hash = sha256_hex({loaded.hash, key});
        loaded.runs_hash = sha256_hex({loaded.runs_hash, key});
    }
    return loaded;
}

Report run_job(const LoadedJob& loaded, const std::vector<OutputRequest>& files, const RunOptions& options,
               const Monitor& monitor) {
    const MeasureKind& kind = kind_of(loaded.job.plan);
    if (options.shard_task.kind != ShardTask::Kind::compute_all &&
        !std::holds_alternative<BrdfPlan>(loaded.job.plan))
        throw Error(ErrorCode::invalid_input, "/measure/kind", kind.name,
                    "only brdf jobs are cut into shards: gonio run");
    // Streamed files need their folders now; those of a table are made when there is one (write_outputs), so
    // that a job whose shards are missing leaves nothing behind.
    if (!std::holds_alternative<BrdfPlan>(loaded.job.plan))
        for (const OutputRequest& file : files) make_folder_of(file.path);
    return kind.run(loaded, files, options, monitor);
}

BrdfResult run_brdf(const LoadedJob& loaded, const RunOptions& options, const Monitor& monitor) {
    const auto& plan = std::get<BrdfPlan>(loaded.job.plan);
    BrdfResult result = loaded.reference
                            ? measure_reference(loaded.surface.surface, loaded.material, plan,
                                                *loaded.reference, options, monitor)
                            : measure_brdf(loaded.surface.surface, loaded.material, plan, options, monitor);
    const auto origin = job_provenance(loaded);
    result.table.provenance.insert(result.table.provenance.begin(), origin.begin(), origin.end());
    if (const BaseCurvature& base = loaded.surface.surface.base; base.is_curved()) {
        char text[120];
        std::snprintf(text, sizeof text, "%.9g 1/m at %.9g degrees from x, %.9g 1/m across", base.kappa_1,
                      degrees(base.direction), base.kappa_2);
        result.table.provenance.emplace_back("base", text);
    }
    return result;
}

std::vector<std::pair<std::string, std::string>> job_provenance(const LoadedJob& loaded) {
    const uint64_t seed = std::visit([](const auto& plan) { return plan.accuracy.seed; }, loaded.job.plan);
    return {{"program", program_version()},
            {"job_hash", loaded.hash},
            {"surface_hash", loaded.surface.hash},
            {"surface", size_of(loaded.surface.surface)},
            {"seed", std::to_string(seed)}};
}

std::vector<OutputRequest> output_files(const LoadedJob& loaded, const std::string& folder) {
    std::vector<OutputRequest> files = loaded.job.outputs;
    for (OutputRequest& file : files) {
        std::filesystem::path path(file.path);
        if (loaded.reference)
            path.replace_filename(path.stem().string() + ".reference" + path.extension().string());
        file.path = (std::filesystem::path(folder) / path).lexically_normal().string();
    }
    return files;
}

void write_outputs(const LoadedJob& loaded, BrdfResult& result, const std::vector<OutputRequest>& outputs) {
    for (const OutputRequest& output : outputs) make_folder_of(output.path);
    if (const auto& plan = std::get<BrdfPlan>(loaded.job.plan); plan.project) {
        const HarmonicProjection projection = project(result.table, *plan.project);
        add_to_report(projection, result.report);
        for (const OutputRequest& output : outputs) write_projection(projection, output.format, output.path);
    } else {
        for (const OutputRequest& output : outputs) write_table(result.table, output.format, output.path);
    }
}

bool is_result_of(const std::string& path, const std::string& job_hash) {
    // The header of an OpenEXR file lists thousands of channels before it comes to "job_hash".
    constexpr std::streamsize looked_at = 2 << 20;
    std::ifstream in(path, std::ios::binary);
    const auto is_next = [&] {
        std::string bytes(looked_at, '\0');
        in.read(bytes.data(), looked_at);
        bytes.resize(static_cast<size_t>(std::max<std::streamsize>(in.gcount(), 0)));
        return bytes.find(job_hash) != std::string::npos;
    };
    if (is_next()) return true;
    if (!in || !in.seekg(-looked_at, std::ios::end)) return false;  // there was no more
    return is_next();
}

}  // namespace gonio
