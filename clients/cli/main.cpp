// gonio: the virtual gonioreflectometer on the command line.
#include <CLI/CLI.hpp>
#include <iostream>

#include "clients/cli/command_tree.h"
#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/cli/execute.h"
#include "clients/cli/interrupt.h"
#include "server/job_hash.h"
#include "server/result_json.h"

namespace {

// Examples (the footer) before the options: most people need no more.
class ExamplesFirst : public CLI::Formatter {
  public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
        if (mode == CLI::AppFormatMode::Sub) return make_expanded(app);
        return make_description(app) + make_usage(app, name) + "\nExamples:\n" + make_footer(app) +
               make_positionals(app) + make_groups(app, mode) + make_subcommands(app, mode);
    }
};

// "gonio: error: ..." and where to read on. CLI11 says of an unknown subcommand only that one is required.
int usage_error(const CLI::App& app, const std::string& first_argument, const std::string& message) {
    std::string names, help = "gonio --help";
    bool is_unknown = !first_argument.empty() && first_argument[0] != '-';
    for (const CLI::App* command : gonio::visible_commands(app)) {
        names += (names.empty() ? "" : ", ") + command->get_name();
        if (command->get_name() != first_argument) continue;
        is_unknown = false;
        help = "gonio " + first_argument + " --help";
    }
    gonio::print_error((is_unknown ? "\"" + first_argument + "\" is none of " + names : message) + " (see " +
                       help + ")");
    return gonio::exit_code(gonio::ErrorCode::usage);
}

int fail(const gonio::Error& error, const gonio::CommonOptions& common) {
    gonio::print_error(error.what());
    if (common.json) std::cout << gonio::failure_json(error) << std::endl;
    return gonio::exit_code(error.code());
}

}  // namespace

int main(int argc, char** argv) {
    gonio::CommonOptions common;
    gonio::Action action;
    CLI::App app(
        "gonio simulates a gonioreflectometer: from a height field to its BRDF, each value with its error.",
        "gonio");
    app.formatter(std::make_shared<ExamplesFirst>());
    app.footer(
        "  gonio measure lava.png --width 50mm --height-range 5mm --albedo 0.8 --target-error 0.003 -o "
        "lava.csv\n"
        "  gonio plot lava.csv -o lobes.svg      polar lobes with error bands\n"
        "  gonio run lava.json                   a job document (gonio measure --print-job makes one)\n"
        "  gonio info scan.gsf                   what is this surface?\n"
        "  gonio measure --help                  every option, with examples\n"
        "Exit codes: 0 ok, 1 job failed, 2 wrong usage, 3 invalid input, 4 server unreachable, 5 cancelled, "
        "6 beyond a limit, 7 "
        "shards are missing, 130 Ctrl-C.");
    app.set_version_flag("--version", gonio::program_version());
    app.require_subcommand(1);
    gonio::add_measure(app, common, action);
    gonio::add_run(app, common, action);
    gonio::add_batch(app, common, action);
    gonio::add_expand(app, common, action);
    gonio::add_info(app, common, action);
    gonio::add_reference(app, common, action);
    gonio::add_shard(app, common, action);
    gonio::add_merge(app, common, action);
    gonio::add_dispatch(app, common, action);
    gonio::add_serve(app, common, action);
    gonio::add_decode_untrusted(app, action);
    gonio::add_remote_commands(app, common, action);
    gonio::add_store(app, common, action);
    gonio::add_project(app, common, action);
    gonio::add_plot(app, common, action);
    gonio::add_ndf(app, common, action);
    gonio::add_schema(app, action);
    gonio::add_completions(app, action);
    gonio::add_man_pages(app, action);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
        return usage_error(app, argc > 1 ? argv[1] : "", error.what());
    }
    gonio::install_interrupt_handlers();
    try {
        return action();
    } catch (const gonio::Error& error) {
        return fail(error, common);
    } catch (const std::bad_alloc&) {
        return fail({gonio::ErrorCode::limit, "", "",
                     "out of memory: crop or resample the surface, or ask for fewer directions"},
                    common);
    } catch (const std::exception& error) {
        return fail({gonio::ErrorCode::internal, "", "", std::string("a defect of gonio: ") + error.what()},
                    common);
    }
}
