// gonio shard and gonio merge: one job on many machines. Shards lie in a folder that the machines share; one
// may be computed twice or lost with its machine, and the merged result has the bits of `gonio run`.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/cli/execute.h"
#include "server/service/uploads.h"

namespace gonio {
namespace {

struct ShardedJob {
    std::string path;
    int index = 0;
    long long reference_paths = 0;  // > 0: by the path tracer
    bool untrusted = false;

    LoadedJob load() const {
        std::optional<ReferenceOptions> reference;
        if (reference_paths > 0) reference = ReferenceOptions{reference_paths};
        Job job = read_job(path);
        if (untrusted) read_as_untrusted(job);
        return load_job(job, reference);
    }
};

void print_missing(const MissingShards& missing) {
    for (const Shard& shard : missing.shards()) std::cout << shard.index << "\n";
    std::cout << std::flush;
}

int run_shard(const ShardedJob& sharded, const CommonOptions& common) {
    const LoadedJob loaded = sharded.load();
    try {
        run_and_write(loaded, {}, common, {ShardTask::Kind::compute_one, sharded.index});
    } catch (const ShardDone&) {
        return 0;
    } catch (const MissingShards& missing) {
        print_error("shard " + std::to_string(sharded.index) + " cannot be planned before " + missing.what());
        return shards_missing_exit_code;
    }
    throw Error(ErrorCode::invalid_input, "--index", std::to_string(sharded.index),
                "the job has fewer shards: `gonio merge` can end it");
}

int merge_shards(const ShardedJob& sharded, const CommonOptions& common) {
    const LoadedJob loaded = sharded.load();
    const std::vector<OutputRequest> files = output_files(loaded, common.folder);
    try {
        const Report report = run_and_write(loaded, files, common, {ShardTask::Kind::compute_none, 0});
        print_result(loaded, report, files, common);
    } catch (const MissingShards& missing) {
        print_missing(missing);
        if (!common.quiet) print_warning("these shards are not there yet");
        return shards_missing_exit_code;
    }
    return 0;
}

void add_common(CLI::App& command, ShardedJob& sharded, CommonOptions& common) {
    command.add_option("--reference", sharded.reference_paths, "Path tracer, with this many paths a view")
        ->check(CLI::Range(1LL, 1LL << 40));
    add_run_options(command, common);
    command.get_option("--checkpoints")->required();
}

}  // namespace

void add_shard(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command = app.add_subcommand("shard", "Compute one shard of a job, here or on another machine");
    command->footer(
        "  gonio merge lava.json --checkpoints /shared/work       prints the shards that are wanted: 0 1 2 3 "
        "4 5\n"
        "  gonio shard --job lava.json --index 3 --checkpoints /shared/work\n"
        "  gonio merge lava.json --checkpoints /shared/work       writes the table, or asks for more\n"
        "Shards may be computed anywhere, in any order, twice.");
    const auto sharded = std::make_shared<ShardedJob>();
    command->add_option("--job", sharded->path, "Job document (JSON)")->required();
    command->add_option("--index", sharded->index, "Number of the shard")
        ->required()
        ->check(CLI::Range(0, 1 << 30));
    command->add_flag("--untrusted", sharded->untrusted,
                      "Its files are strangers': OpenEXR is decoded in a process that can do nothing else");
    add_common(*command, *sharded, common);
    command->callback(
        [sharded, &common, &action] { action = [sharded, &common] { return run_shard(*sharded, common); }; });
}

void add_merge(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command =
        app.add_subcommand("merge", "Put the shards of a job together, or say which are missing");
    command->footer(
        "  gonio merge lava.json --checkpoints /shared/work -o results\n"
        "Exit code 7: the shards whose numbers it prints are wanted first, one a line.");
    const auto sharded = std::make_shared<ShardedJob>();
    command->add_option("JOB", sharded->path, "Job document (JSON)")->required();
    command->add_option("-o,--output", common.folder, "Folder of the outputs")->capture_default_str();
    add_common(*command, *sharded, common);
    command->callback([sharded, &common, &action] {
        action = [sharded, &common] { return merge_shards(*sharded, common); };
    });
}

}  // namespace gonio
