// gonio man-pages FOLDER (hidden, for the build): gonio.1, gonio-run.1 and so on, from the command tree.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <sstream>

#include "base/atomic_file.h"
#include "clients/cli/command_tree.h"
#include "clients/cli/commands.h"
#include "server/job_hash.h"

namespace gonio {
namespace {

// Text as groff prints it letter by letter: what can be pasted into a shell stays so.
std::string escaped(const std::string& text) {
    std::string result;
    for (const char c : text) {
        switch (c) {
            case '\\':
                result += "\\e";
                break;
            case '-':
                result += "\\-";
                break;
            case '\'':
                result += "\\(aq";
                break;
            case '`':
                result += "\\(ga";
                break;
            case '^':
                result += "\\(ha";
                break;
            case '~':
                result += "\\(ti";
                break;
            default:
                result += c;
        }
    }
    return result.starts_with('.') ? "\\&" + result : result;
}

// A description of the help as a sentence.
std::string sentence(const std::string& text) {
    const bool has_end = !text.empty() && std::string(".?!").find(text.back()) != std::string::npos;
    return escaped(text) + (has_end ? "\n" : ".\n");
}

std::string bold(const std::string& text) {
    return "\\fB" + escaped(text) + "\\fR";
}
std::string italic(const std::string& text) {
    return "\\fI" + escaped(text) + "\\fR";
}

// "gonio-store-gc"
std::string page_name(const CLI::App& command) {
    std::string name = full_name(command);
    std::replace(name.begin(), name.end(), ' ', '-');
    return name;
}

// "INT:INT in [1 - 1024]" -> "INT" and "INT in [1 - 1024]"
std::pair<std::string, std::string> type_and_check(const CLI::Option& option) {
    const std::string type = option.get_type_name();
    const size_t colon = type.find(':');
    return {type.substr(0, colon), colon == std::string::npos ? "" : type.substr(colon + 1)};
}

void write_option(std::ostream& out, const CLI::Option& option) {
    const auto [type, check] = type_and_check(option);
    out << ".TP\n";
    if (option.get_positional()) {
        out << italic(option.get_name(true));
    } else {
        std::string separator;
        for (const std::string& name : option.get_snames())
            out << separator << bold("-" + name), separator = ", ";
        for (const std::string& name : option.get_lnames())
            out << separator << bold("--" + name), separator = ", ";
        if (option.get_type_size() > 0) out << " " << italic(type);
    }
    out << "\n" << sentence(option.get_description());
    if (!check.empty()) out << "Allowed: " << escaped(check) << ".\n";
    if (!option.get_default_str().empty()) out << "Default: " << escaped(option.get_default_str()) << ".\n";
    if (option.get_required()) out << "Required.\n";
}

void write_options(std::ostream& out, const CLI::App& command) {
    const std::vector<const CLI::Option*> positionals = visible_options(command, true);
    if (!positionals.empty()) out << ".SH ARGUMENTS\n";
    for (const CLI::Option* option : positionals) write_option(out, *option);
    out << ".SH OPTIONS\n";
    for (const std::string& group : command.get_groups()) {
        std::ostringstream options;
        for (const CLI::Option* option : visible_options(command, false))
            if (option->get_group() == group) write_option(options, *option);
        if (options.str().empty()) continue;
        if (group != "Options") out << ".SS " << escaped(group) << "\n";
        out << options.str();
    }
}

// Lines of a footer that begin with two spaces are examples, the others prose.
void write_footer(std::ostream& out, const std::string& footer) {
    std::string examples, notes;
    std::istringstream lines(footer);
    for (std::string line; std::getline(lines, line);)
        if (line.starts_with("  "))
            examples += escaped(line.substr(2)) + "\n";
        else
            notes += escaped(line) + "\n";
    if (!examples.empty()) out << ".SH EXAMPLES\n.EX\n" << examples << ".EE\n";
    if (!notes.empty()) out << ".SH NOTES\n" << notes;
}

void write_page(std::ostream& out, const CLI::App& command, const std::string& date) {
    const std::string name = page_name(command);
    const std::vector<const CLI::App*> children = visible_commands(command);
    const CLI::App* parent = command.get_parent();
    std::string title = name;
    std::transform(title.begin(), title.end(), title.begin(),
                   [](unsigned char c) { return std::toupper(c); });
    out << ".TH " << escaped(title) << " 1 \"" << date << "\" \"" << program_version()
        << "\" \"User Commands\"\n"
        << ".SH NAME\n"
        << escaped(name) << " \\- " << escaped(command.get_description()) << "\n"
        << ".SH SYNOPSIS\n"
        << bold(full_name(command)) << " [" << italic("OPTIONS") << "]";
    if (!children.empty()) out << " " << italic("COMMAND") << " ...";
    for (const CLI::Option* option : visible_options(command, true)) {
        const std::string more = option->get_expected_max() > 1 ? "..." : "";
        const std::string word = italic(option->get_name(true)) + more;
        out << " " << (option->get_required() ? word : "[" + word + "]");
    }
    out << "\n";
    if (!children.empty()) out << ".SH COMMANDS\n";
    for (const CLI::App* child : children)
        out << ".TP\n" << bold(page_name(*child)) << "(1)\n" << sentence(child->get_description());
    write_options(out, command);
    write_footer(out, command.get_footer());
    if (parent) out << ".SH SEE ALSO\n" << bold(page_name(*parent)) << "(1)\n";
}

void write_pages(const CLI::App& command, const std::filesystem::path& folder, const std::string& date) {
    write_file_atomically((folder / (page_name(command) + ".1")).string(),
                          [&](std::ostream& out) { write_page(out, command, date); });
    for (const CLI::App* child : visible_commands(command)) write_pages(*child, folder, date);
}

}  // namespace

void add_man_pages(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("man-pages", "Write the manual pages")->group("");
    const auto folder = std::make_shared<std::string>(), date = std::make_shared<std::string>();
    command->add_option("FOLDER", *folder, "Where to")->required();
    command->add_option("--date", *date, "Date of the pages, such as 2025-01-31")->required();
    command->callback([folder, date, &app, &action] {
        action = [folder, date, &app] {
            write_pages(app, *folder, *date);
            return 0;
        };
    });
}

}  // namespace gonio
