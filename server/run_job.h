// A job from its document to its files.
#pragma once
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/brdf.h"
#include "measure/reference.h"
#include "server/job.h"
#include "server/load_job.h"

namespace gonio {

// A job with its surface and material in memory, ready to run.
struct LoadedJob {
    Job job;
    LoadedSurface surface;
    Material material;
    std::optional<ReferenceOptions> reference;    // run by the path tracer instead of the fast engine
    std::optional<Environment> environment = {};  // of the kinds that take one; part of both hashes
    std::string hash = {};                        // job_hash
    std::string runs_hash = {};
};

// Throws Error, also for a reference of another kind than brdf.
LoadedJob load_job(const Job& job, const std::optional<ReferenceOptions>& reference = std::nullopt);

// Runs a job of any kind and writes its files; missing folders are made. Throws Error, also for a kind
// without shards if options.shard_task asks for some.
Report run_job(const LoadedJob& loaded, const std::vector<OutputRequest>& files, const RunOptions& options,
               const Monitor& monitor = {});

// The table of a job of kind brdf, not yet written. Its provenance opens with job_provenance(); what the
// engine chose follows.
BrdfResult run_brdf(const LoadedJob& loaded, const RunOptions& options, const Monitor& monitor = {});

// What every result says about where it comes from: program, job_hash, surface_hash, surface, seed.
std::vector<std::pair<std::string, std::string>> job_provenance(const LoadedJob& loaded);

// Where the outputs of a job go under `folder`; a reference writes "lava.reference.csv" for "lava.csv".
std::vector<OutputRequest> output_files(const LoadedJob& loaded, const std::string& folder);

// Writes every output of a job of kind brdf, its table or what the table is projected to; missing folders are
// made. The report then says how well the projection fits.
void write_outputs(const LoadedJob& loaded, BrdfResult& result, const std::vector<OutputRequest>& outputs);

// Whether `path` is a result of this very job: its head carries the hash, or (.npy) its end. Files are
// renamed into place whole, so a head that is there stands for the whole file; and 64 hex digits do not
// appear by chance, so that no format needs a reader for this.
bool is_result_of(const std::string& path, const std::string& job_hash);

}  // namespace gonio
