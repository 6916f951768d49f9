// gonio expand: the images of a BTF that was kept in its factored form.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "clients/cli/commands.h"
#include "clients/cli/console.h"
#include "clients/cli/interrupt.h"
#include "server/btf_file.h"

namespace gonio {

void add_expand(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command = app.add_subcommand("expand", "Write the images of a factored BTF");
    command->footer(
        "  gonio expand lava.btf -o lava.images\n"
        "  gonio expand lava.btf -o lava.npy\n"
        "The same bytes as the output {\"format\": \"images\"} or \"npy\" of the job (server/README.md).");
    const auto factored = std::make_shared<std::string>(), images = std::make_shared<std::string>();
    command->add_option("FILE", *factored, "Factored BTF, an output of format btf")->required();
    command->add_option("-o,--output", *images,
                        "File to write; .npy: for NumPy (default: its name with .images)");
    command->add_flag("-q,--quiet", common.quiet, "Print nothing but errors on stderr");
    command->callback([factored, images, &common, &action] {
        action = [factored, images, &common] {
            if (images->empty())
                *images = std::filesystem::path(*factored).replace_extension(".images").string();
            Monitor monitor;
            monitor.cancel_requested = &interrupt_requested();
            ProgressBar bar(common.quiet);
            monitor.on_progress = [&](const Progress& progress) { bar.update(progress); };
            const bool is_npy = std::filesystem::path(*images).extension() == ".npy";
            expand_btf(*factored, is_npy ? ImageForm::npy : ImageForm::arrays, *images, monitor);
            if (!common.quiet) std::cerr << "wrote " << *images << std::endl;
            return 0;
        };
    });
}

}  // namespace gonio
