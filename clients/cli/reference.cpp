// gonio reference JOB.json
#include <CLI/CLI.hpp>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/execute.h"

namespace gonio {

void add_reference(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command =
        app.add_subcommand("reference", "Run the path tracer on a job: slow, unbiased, the judge");
    command->footer(
        "  gonio reference lava.json --paths 65536   writes lava.reference.csv where `gonio run` writes "
        "lava.csv");
    const auto path = std::make_shared<std::string>();
    const auto reference = std::make_shared<ReferenceOptions>();
    command->add_option("JOB", *path, "Job document (JSON); - reads stdin")->required();
    command
        ->add_option("--paths", reference->paths,
                     "Paths from each outgoing direction, rounded up to a square")
        ->check(CLI::Range(1LL, 1LL << 40))
        ->capture_default_str();
    command->add_option("-o,--output", common.folder, "Folder of the outputs")->capture_default_str();
    add_run_options(*command, common);
    command->callback([path, reference, &common, &action] {
        action = [path, reference, &common] { return execute_job(read_job(*path), common, *reference); };
    });
}

}  // namespace gonio
