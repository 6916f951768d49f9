// gonio plot TABLE
#include "clients/plot/plot.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "clients/cli/commands.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

struct PlotCommand {
    std::string table;
    std::vector<std::string> outputs;
    PlotOptions options;
};

int plot(const PlotCommand& command, const CommonOptions& common) {
    const Table table = read_table(command.table);
    std::vector<std::string> paths = command.outputs;
    if (paths.empty()) paths.push_back(std::filesystem::path(command.table).stem().string() + ".svg");
    for (const std::string& path : paths) {
        plot_table(table, path, command.options);
        if (!common.quiet) std::cerr << "wrote " << path << std::endl;
    }
    return 0;
}

}  // namespace

void add_plot(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* sub =
        app.add_subcommand("plot", "Draw a table: polar lobes with error bands and a hemisphere map");
    sub->footer(
        "  gonio plot lava.csv -o lobes.svg\n"
        "  gonio plot lava.json -o lobes.png --incident 3 --channel 550nm --log");
    const auto command = std::make_shared<PlotCommand>();
    sub->add_option("TABLE", command->table, "Table that gonio wrote: CSV or JSON")->required();
    sub->add_option("-o,--output", command->outputs,
                    "Picture: .svg or .png; may be repeated (default: TABLE's name with .svg)")
        ->take_all();
    sub->add_option("--title", command->options.title, "Default: the surface's name");
    sub->add_option("--incident", command->options.incident,
                    "Index of the map's incident direction (default: nearest to 45 degrees)")
        ->check(CLI::NonNegativeNumber);
    sub->add_option("--channel", command->options.channel, "Of the map (default: the middle one)");
    sub->add_flag("--log", command->options.log_scale, "Logarithmic colours");
    sub->add_flag("-q,--quiet", common.quiet, "Print nothing but errors on stderr");
    sub->callback(
        [command, &common, &action] { action = [command, &common] { return plot(*command, common); }; });
}

}  // namespace gonio
