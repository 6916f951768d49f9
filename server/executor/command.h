// Programs of others, run by the shell within a time limit.
#pragma once
#include <chrono>
#include <string>

namespace gonio {

struct CommandResult {
    int exit_code = 0;  // 124: the time was over; 127: no such program; 128 + n: signal n
    std::string output;
};

// What /bin/sh makes of `command` (which may redirect 2>&1). After `limit` it is ended, and killed if it does
// not end. Throws Error(io) if no process can be started.
CommandResult run_command(const std::string& command, std::chrono::seconds limit);

// As one word of a shell command, whatever it contains.
std::string shell_quoted(const std::string& word);

}  // namespace gonio
