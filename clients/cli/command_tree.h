// The subcommands and options of the program, as help, completions and man pages read them.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace gonio {

// An empty group hides a subcommand or an option from help.
inline std::vector<const CLI::App*> visible_commands(const CLI::App& command) {
    return command.get_subcommands([](const CLI::App* child) { return !child->get_group().empty(); });
}

inline std::vector<const CLI::Option*> visible_options(const CLI::App& command, bool positional) {
    return command.get_options([positional](const CLI::Option* option) {
        return !option->get_group().empty() && option->get_positional() == positional;
    });
}

// Null if there is none.
inline const CLI::App* find_command(const CLI::App& command, const std::string& name) {
    for (const CLI::App* child : visible_commands(command))
        if (child->get_name() == name) return child;
    return nullptr;
}

// "gonio store gc"
inline std::string full_name(const CLI::App& command) {
    const CLI::App* parent = command.get_parent();
    return (parent ? full_name(*parent) + " " : "") + command.get_name();
}

}  // namespace gonio
