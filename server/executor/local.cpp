#include "server/executor/local.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <thread>

#include "base/error.h"

namespace gonio {
namespace {

// Leads a process group, so that Ctrl-C reaches it through cancel() alone and its own children end with it.
pid_t start(const std::string& script, const std::string& index) {
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    // What a shard says is in its failure, if it has one.
    for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        posix_spawn_file_actions_addopen(&files, fd, "/dev/null", O_RDWR, 0);
    char* arguments[] = {const_cast<char*>(script.c_str()), const_cast<char*>(index.c_str()), nullptr};
    pid_t pid = 0;
    const int error = ::posix_spawn(&pid, script.c_str(), &files, &attributes, arguments, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
    if (error)
        throw Error(ErrorCode::io, script, "", std::string("cannot be started: ") + std::strerror(error));
    return pid;
}

}  // namespace

LocalExecutor::LocalExecutor(const ExecutorOptions& options)
    : at_once_(options.at_once > 0
                   ? options.at_once
                   : std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / options.threads)) {}

LocalExecutor::~LocalExecutor() {
    end_all();
}

void LocalExecutor::submit(const JobFolder& job, const Submission& submission) {
    script_ = job.script();
    waiting_.insert(waiting_.end(), submission.indices.begin(), submission.indices.end());
}

std::optional<std::set<int>> LocalExecutor::poll(const JobFolder&) {
    std::erase_if(running_, [](const auto& child) { return ::waitpid(child.first, nullptr, WNOHANG) != 0; });
    while (!waiting_.empty() && running_.size() < at_once_) {
        running_.emplace(start(script_, std::to_string(waiting_.front())), waiting_.front());
        waiting_.pop_front();
    }
    std::set<int> shards(waiting_.begin(), waiting_.end());
    for (const auto& [pid, index] : running_) shards.insert(index);
    return shards;
}

void LocalExecutor::cancel(const JobFolder&) {
    end_all();
}

// They have nothing to tidy up: a shard is saved whole or not at all.
void LocalExecutor::end_all() {
    waiting_.clear();
    for (const auto& [pid, index] : running_) ::kill(-pid, SIGKILL);
    for (const auto& [pid, index] : running_) ::waitpid(pid, nullptr, 0);
    running_.clear();
}

}  // namespace gonio
