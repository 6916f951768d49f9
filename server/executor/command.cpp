#include "server/executor/command.h"

#include <sys/wait.h>

#include <array>
#include <cstdio>

#include "base/error.h"

namespace gonio {

CommandResult run_command(const std::string& command, std::chrono::seconds limit) {
    // In a process group of its own, so that Ctrl-C does not reach it: whoever cancels still needs its
    // answers.
    const std::string limited = "timeout --kill-after=5 " + std::to_string(limit.count()) + " /bin/sh -c " +
                                shell_quoted(command) + " < /dev/null";
    std::FILE* pipe = ::popen(limited.c_str(), "re");
    if (!pipe) throw Error(ErrorCode::io, command, "", "cannot be started");
    CommandResult result;
    std::array<char, 65536> piece;
    for (size_t n; (n = std::fread(piece.data(), 1, piece.size(), pipe)) > 0;)
        result.output.append(piece.data(), n);
    const int status = ::pclose(pipe);
    result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return result;
}

std::string shell_quoted(const std::string& word) {
    std::string quoted = "'";
    for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return quoted + "'";
}

}  // namespace gonio
