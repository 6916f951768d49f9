// The subcommands, one file each. A new one is a file, a declaration here and a line in main.cpp.
#pragma once
#include <functional>

#include "clients/cli/options.h"

namespace CLI {
class App;
}

namespace gonio {

// What the chosen subcommand does once the whole command line is parsed; returns the exit code.
using Action = std::function<int()>;

void add_run(CLI::App& app, CommonOptions& common, Action& action);
void add_measure(CLI::App& app, CommonOptions& common, Action& action);
void add_expand(CLI::App& app, CommonOptions& common, Action& action);
void add_batch(CLI::App& app, CommonOptions& common, Action& action);
void add_info(CLI::App& app, CommonOptions& common, Action& action);
void add_reference(CLI::App& app, CommonOptions& common, Action& action);
void add_shard(CLI::App& app, CommonOptions& common, Action& action);
void add_merge(CLI::App& app, CommonOptions& common, Action& action);
void add_decode_untrusted(CLI::App& app, Action& action);
void add_dispatch(CLI::App& app, CommonOptions& common, Action& action);
void add_serve(CLI::App& app, CommonOptions& common, Action& action);
void add_remote_commands(CLI::App& app, CommonOptions& common, Action& action);
void add_store(CLI::App& app, CommonOptions& common, Action& action);
void add_project(CLI::App& app, CommonOptions& common, Action& action);
void add_plot(CLI::App& app, CommonOptions& common, Action& action);
void add_ndf(CLI::App& app, CommonOptions& common, Action& action);
void add_schema(CLI::App& app, Action& action);
void add_completions(CLI::App& app, Action& action);
void add_man_pages(CLI::App& app, Action& action);

}  // namespace gonio
