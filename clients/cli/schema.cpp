// gonio schema
#include <CLI/CLI.hpp>
#include <iostream>

#include "clients/cli/commands.h"
#include "server/job.h"

namespace gonio {

void add_schema(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("schema", "Print the JSON Schema of the job document");
    command->footer("  gonio schema > job_schema.json");
    command->callback([&action] {
        action = [] {
            std::cout << job_schema() << std::flush;
            return 0;
        };
    });
}

}  // namespace gonio
