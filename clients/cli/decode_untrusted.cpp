// gonio decode-untrusted heights|radiance FILE: the child in which the service decodes files of strangers;
// not for people.
#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <utility>

#include "clients/cli/commands.h"
#include "server/service/untrusted.h"

namespace gonio {

void add_decode_untrusted(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("decode-untrusted");
    command->group("");  // hidden
    const auto file = std::make_shared<std::pair<std::string, std::string>>();
    command->add_option("CONTENT", file->first)->required()->check(CLI::IsMember({"heights", "radiance"}));
    command->add_option("FILE", file->second)->required();
    command->callback(
        [file, &action] { action = [file] { return decode_untrusted(file->first, file->second); }; });
}

}  // namespace gonio
