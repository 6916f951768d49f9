// gonio run JOB.json
#include <CLI/CLI.hpp>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/execute.h"
#include "clients/cli/remote_job.h"

namespace gonio {

void add_run(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command = app.add_subcommand("run", "Run a job document");
    command->footer(
        "  gonio run lava.json                   write what the job's \"output\" asks for into this folder\n"
        "  gonio run lava.json -o results        into results/\n"
        "  gonio run lava.json --dry-run         check it, show the surface and the job's hash, run nothing\n"
        "  gonio run lava.json --server http://host:8080     on a service: the same files, the same bytes\n"
        "  generate-a-job | gonio run - --json   job from stdin, machine-readable report on stdout\n"
        "Relative input files are looked up beside the job document. `gonio schema` prints the JSON Schema.");
    const auto path = std::make_shared<std::string>();
    command->add_option("JOB", *path, "Job document (JSON); - reads stdin")->required();
    command->add_option("-o,--output", common.folder, "Folder of the outputs")->capture_default_str();
    add_run_options(*command, common);
    const auto remote = std::make_shared<RemoteOptions>();
    add_remote_options(*command, *remote);
    command->callback([path, remote, &common, &action] {
        action = [path, remote, &common] {
            if (!remote->server.empty()) return execute_remotely(*path, *remote, common);
            return execute_job(read_job(*path), common);
        };
    });
}

}  // namespace gonio
