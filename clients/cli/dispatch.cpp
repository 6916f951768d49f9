// gonio dispatch: one job on many machines, through whatever engine they have.
#include "server/executor/dispatch.h"

#include <CLI/CLI.hpp>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/cli/execute.h"

namespace gonio {
namespace {

struct DispatchedJob {
    std::string path, executor = "local";
    long long reference_paths = 0;  // > 0: by the path tracer
    ExecutorOptions options;
    std::string program;
};

int run_dispatch(const DispatchedJob& dispatched, const CommonOptions& common) {
    const std::string text = read_text(dispatched.path);
    const JobOrigin origin = origin_of(dispatched.path);
    std::optional<ReferenceOptions> reference;
    if (dispatched.reference_paths > 0) reference = ReferenceOptions{dispatched.reference_paths};
    const LoadedJob loaded = load_job(parse_job(text, origin), reference);
    const std::unique_ptr<Executor> executor = make_executor(dispatched.executor, dispatched.options);
    if (!common.quiet) print_surface(loaded.surface, std::cerr);
    const RunJob run = [&](const LoadedJob&, const std::vector<OutputRequest>& outputs,
                           const RunOptions& options, const Monitor& monitor) {
        const JobFolder folder(
            common.checkpoints, loaded, text, origin.folder,
            {dispatched.program.empty() ? this_program() : dispatched.program, dispatched.options.threads},
            options);
        BrdfResult result = dispatch(loaded, folder, *executor, options, monitor);
        monitor.check_cancelled();
        write_outputs(loaded, result, outputs);
        return result.report;
    };
    const std::vector<OutputRequest> files = output_files(loaded, common.folder);
    print_result(loaded, run_and_write(loaded, files, common, {}, run), files, common);
    return 0;
}

}  // namespace

void add_dispatch(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command = app.add_subcommand("dispatch", "Run a job document on many machines");
    command->footer(
        "  gonio dispatch lava.json --executor slurm --checkpoints /shared/work -o results\n"
        "  gonio dispatch lava.json --executor engine.json --checkpoints /shared/work   commands of your "
        "own\n"
        "  gonio dispatch lava.json --executor local --at-once 4 --checkpoints work     processes of this "
        "machine\n"
        "The folder of --checkpoints, and gonio, must be at the same place on every machine. The table has "
        "the bits "
        "of `gonio run`.\nCtrl-C cancels the shards that are queued or running; the same command goes on "
        "where it was. "
        "Slurm's partition, account,\nmemory and time limit: SBATCH_PARTITION, SBATCH_ACCOUNT, "
        "SBATCH_MEM_PER_CPU, "
        "SBATCH_TIMELIMIT.");
    const auto dispatched = std::make_shared<DispatchedJob>();
    command->add_option("JOB", dispatched->path, "Job document (JSON); - reads stdin")->required();
    command->add_option("-o,--output", common.folder, "Folder of the outputs")->capture_default_str();
    command
        ->add_option("--executor", dispatched->executor,
                     "local, slurm, or a file of command templates (deploy/executors)")
        ->capture_default_str();
    command
        ->add_option("--at-once", dispatched->options.at_once,
                     "Shards that run at once (default: all there is room for)")
        ->check(CLI::Range(1, 1 << 20));
    command->add_option("--shard-threads", dispatched->options.threads, "Threads of each shard")
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    command->add_option("--program", dispatched->program,
                        "gonio as the other machines call it (default: this one's path)");
    command
        ->add_option("--reference", dispatched->reference_paths, "Path tracer, with this many paths a view")
        ->check(CLI::Range(1LL, 1LL << 40));
    add_run_options(*command, common);
    command->get_option("--checkpoints")->required();
    command->remove_option(command->get_option("--dry-run"));
    command->callback([dispatched, &common, &action] {
        action = [dispatched, &common] { return run_dispatch(*dispatched, common); };
    });
}

}  // namespace gonio
