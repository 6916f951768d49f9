// gonio ndf SURFACE
#include "fitting/ndf.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/plot/plot.h"
#include "server/load_job.h"
#include "server/ndf_json.h"

namespace gonio {
namespace {

struct NdfCommand {
    JobFlags flags;
    std::vector<std::string> plots;
    std::string title;
};

int run_ndf(const NdfCommand& command, const CommonOptions& common) {
    const LoadedSurface surface = load_surface(parse_surface_job(compose_job(command.flags.entries()), {}));
    if (!common.quiet) print_surface(surface, std::cerr);
    const NdfResult ndf = measure_ndf(surface.surface);
    for (const std::string& path : command.plots) {
        plot_ndf(ndf, path, command.title.empty() ? surface.description : command.title);
        if (!common.quiet) std::cerr << "wrote " << path << std::endl;
    }
    std::cout << (common.json ? ndf_json(surface, ndf) + "\n" : ndf_text(ndf)) << std::flush;
    return 0;
}

}  // namespace

void add_ndf(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* sub =
        app.add_subcommand("ndf", "Normal distribution of the facets, with Beckmann and GGX fitted");
    sub->footer(
        "  gonio ndf scan.gsf --level plane --boundary open\n"
        "  gonio ndf lava.png --width 50mm --height-range 5mm -o ndf.svg --json");
    const auto command = std::make_shared<NdfCommand>();
    add_surface_flags(*sub, command->flags);
    sub->add_option("-o,--output", command->plots,
                    "Picture of measured and fitted distributions: .svg or .png; may be repeated")
        ->take_all();
    sub->add_option("--title", command->title, "Of the picture (default: the surface's name)");
    add_output_options(*sub, common);
    sub->callback([command, &common, &action] {
        action = [command, &common] {
            return with_flag_names(command->flags, [&] { return run_ndf(*command, common); });
        };
    });
}

}  // namespace gonio
