// gonio decode-untrusted FILE: the child in which the service decodes files of strangers; not for people.
#include <CLI/CLI.hpp>
#include <memory>

#include "clients/cli/commands.h"
#include "server/service/untrusted.h"

namespace gonio {

void add_decode_untrusted(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("decode-untrusted");
    command->group("");  // hidden
    const auto path = std::make_shared<std::string>();
    command->add_option("FILE", *path)->required();
    command->callback([path, &action] { action = [path] { return decode_untrusted(*path); }; });
}

}  // namespace gonio
