// gonio info SURFACE
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "server/load_job.h"
#include "server/result_json.h"

namespace gonio {

void add_info(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command =
        app.add_subcommand("info", "Print a surface's statistics: is it the one that was meant?");
    command->footer(
        "  gonio info lava.png --width 50mm --height-range 5mm\n"
        "  gonio info scan.gsf --level plane --json\n"
        "  gonio info --generate gaussian --samples 256 --pitch 1um --correlation-length 8um --rms-slope "
        "0.5");
    const auto flags = std::make_shared<JobFlags>();
    add_surface_flags(*command, *flags);
    add_output_options(*command, common);
    command->callback([flags, &common, &action] {
        action = [flags, &common] {
            return with_flag_names(*flags, [&] {
                const LoadedSurface surface =
                    load_surface(parse_surface_job(compose_job(flags->entries()), {}));
                if (common.json) {
                    std::cout << surface_json(surface) << std::endl;
                } else {
                    print_surface(surface, std::cout);
                }
                return 0;
            });
        };
    });
}

}  // namespace gonio
