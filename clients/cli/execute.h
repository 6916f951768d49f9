// Running one job for a person: what `run`, `measure`, `reference` and `batch` have in common.
#pragma once
#include <functional>
#include <string>

#include "clients/cli/options.h"
#include "server/run_job.h"

namespace gonio {

// Reads a job file ("-": stdin) and parses it; relative inputs are looked up beside it.
Job read_job(const std::string& path);
JobOrigin origin_of(const std::string& path);

// The text of a file ("-": stdin). Throws Error(not_found), Error(io).
std::string read_text(const std::string& path);

// Shows the surface, runs, writes the outputs, shows the report; or only says what would run. Exit code 0.
// Throws Error.
int execute_job(const Job& job, const CommonOptions& common,
                const std::optional<ReferenceOptions>& reference = std::nullopt);

// The part of it behind loading: runs with a progress bar and writes the outputs. task: which shards are
// computed (measure/shards.h, which says what is thrown), --checkpoints is where the others are found.
// run: what computes the result and writes the files, if not this process.
using RunJob = std::function<Report(const LoadedJob&, const std::vector<OutputRequest>&, const RunOptions&,
                                    const Monitor&)>;
Report run_and_write(const LoadedJob& loaded, const std::vector<OutputRequest>& files,
                     const CommonOptions& common, const ShardTask& task = {}, const RunJob& run = run_job);

// Says what was done and written.
void print_result(const LoadedJob& loaded, const Report& report, const std::vector<OutputRequest>& files,
                  const CommonOptions& common);

// 1 failed, 2 wrong usage, 3 invalid input, 4 server unreachable, 5 cancelled, 6 beyond a limit, 130 Ctrl-C.
int exit_code(ErrorCode code);

// Its file, for others to call. Throws Error(io) where /proc does not tell.
std::string this_program();
// Of `gonio shard` and `gonio merge`, which need other shards first.
inline constexpr int shards_missing_exit_code = 7;

}  // namespace gonio
