// gonio completions: tab completion. A shell's script only asks `gonio complete`, which reads the command
// tree: no list of options is kept anywhere else.
#include <CLI/CLI.hpp>
#include <iostream>
#include <map>

#include "clients/cli/command_tree.h"
#include "clients/cli/commands.h"

namespace gonio {
namespace {

// Each asks for "WORD<tab>DESCRIPTION" lines, or the one line ":files" where a file name fits.
const std::map<std::string, std::string> scripts = {{"bash", R"(_gonio() {
    local -a words
    local line
    mapfile -t words < <(gonio complete -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2> /dev/null)
    COMPREPLY=()
    if [ "${words[0]}" = :files ]; then
        compopt -o filenames
        mapfile -t COMPREPLY < <(compgen -f -- "${COMP_WORDS[COMP_CWORD]}")
        return
    fi
    for line in "${words[@]}"; do COMPREPLY+=("${line%%$'\t'*}"); done
}
complete -F _gonio gonio
)"},
                                                    {"zsh", R"(#compdef gonio
_gonio() {
    local -a lines candidates
    local line
    lines=("${(@f)$(gonio complete -- "${(@)words[2,CURRENT]}" 2> /dev/null)}")
    if [[ $lines[1] == :files ]]; then
        _files
        return
    fi
    for line in $lines; do candidates+=("${${line%%$'\t'*}//:/\\:}:${line#*$'\t'}"); done
    _describe gonio candidates
}
if [ "$funcstack[1]" = _gonio ]; then _gonio "$@"; else compdef _gonio gonio; fi
)"},
                                                    {"fish", R"(function __gonio_complete
    set -l words (commandline -opc) (commandline -ct)
    set -l lines (gonio complete -- $words[2..-1] 2> /dev/null)
    if test "$lines[1]" = :files
        __fish_complete_path (commandline -ct)
    else
        printf '%s\n' $lines
    end
end
complete -c gonio -f -a '(__gonio_complete)'
)"}};

// "TEXT:{bash,fish,zsh}" -> its words. CLI11 keeps them nowhere but in this name.
std::vector<std::string> choices(const CLI::Option& option) {
    const std::string type = option.get_type_name();
    const size_t open = type.find('{'), close = type.rfind('}');
    if (open == std::string::npos || close == std::string::npos) return {};
    return CLI::detail::split(type.substr(open + 1, close - open - 1), ',');
}

// A text without a list of choices is mostly a file or a folder.
std::vector<std::string> values_of(const CLI::Option& option) {
    if (std::vector<std::string> words = choices(option); !words.empty()) return words;
    return option.get_type_name().starts_with("TEXT") ? std::vector<std::string>{":files"}
                                                      : std::vector<std::string>{};
}

const CLI::Option* find_option(const CLI::App& command, const std::string& word) {
    for (const CLI::Option* option : command.get_options())
        if (option->nonpositional() && option->check_name(word)) return option;
    return nullptr;
}

// What may follow the words before the last, where the last is the beginning of.
std::vector<std::string> candidates(const CLI::App& app, std::vector<std::string> words) {
    const std::string last = words.empty() ? "" : words.back();
    if (!words.empty()) words.pop_back();
    const CLI::App* command = &app;
    size_t n_positionals = 0;
    const CLI::Option* pending = nullptr;  // the option whose value is the next word
    for (const std::string& word : words) {
        if (pending) {
            pending = nullptr;
        } else if (word.starts_with("-") && word != "-") {
            const CLI::Option* option = find_option(*command, word);
            if (option && option->get_type_size() > 0) pending = option;
        } else if (const CLI::App* next = find_command(*command, word)) {
            command = next;
        } else {
            ++n_positionals;
        }
    }
    if (pending) return values_of(*pending);
    std::vector<std::string> result;
    if (last.starts_with("-")) {
        for (const CLI::Option* option : visible_options(*command, false))
            for (const std::string& name : option->get_lnames())
                result.push_back("--" + name + "\t" + option->get_description());
        return result;
    }
    for (const CLI::App* next : visible_commands(*command))
        result.push_back(next->get_name() + "\t" + next->get_description());
    const std::vector<const CLI::Option*> positionals = visible_options(*command, true);
    if (result.empty() && !positionals.empty()) {
        const CLI::Option& positional = *positionals[std::min(n_positionals, positionals.size() - 1)];
        const bool is_full = n_positionals >= positionals.size() && positional.get_expected_max() <= 1;
        if (!is_full) return values_of(positional);
    }
    return result;
}

int complete(const CLI::App& app, const std::vector<std::string>& words) {
    const std::string last = words.empty() ? "" : words.back();
    for (const std::string& candidate : candidates(app, words))
        if (candidate == ":files" || candidate.starts_with(last)) std::cout << candidate << "\n";
    std::cout << std::flush;
    return 0;
}

}  // namespace

void add_completions(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("completions", "Print the tab completion for a shell");
    command->footer(
        "  gonio completions bash > ~/.local/share/bash-completion/completions/gonio\n"
        "  gonio completions zsh > \"${fpath[1]}/_gonio\"\n"
        "  gonio completions fish > ~/.config/fish/completions/gonio.fish");
    const auto shell = std::make_shared<std::string>();
    command->add_option("SHELL", *shell, "Which shell")
        ->required()
        ->check(CLI::IsMember({"bash", "fish", "zsh"}));
    command->callback([shell, &action] {
        action = [shell] {
            std::cout << scripts.at(*shell) << std::flush;
            return 0;
        };
    });

    // Hidden: what the scripts ask. Everything behind -- is the command line so far, the last word
    // unfinished.
    CLI::App* asked = app.add_subcommand("complete", "Print what may follow")->group("");
    const auto words = std::make_shared<std::vector<std::string>>();
    asked->add_option("WORDS", *words);
    asked->callback([words, &app, &action] { action = [words, &app] { return complete(app, *words); }; });
}

}  // namespace gonio
