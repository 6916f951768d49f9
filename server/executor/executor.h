// Where the shards of a job are computed. An executor only starts them and says which it still has: what is
// done, and what failed, is read from the folder that all machines share (job_folder.h). So nothing that an
// engine forgets, repeats or renumbers can lose a shard.
#pragma once
#include <chrono>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "server/executor/job_folder.h"

namespace gonio {

class Executor {
  public:
    virtual ~Executor() = default;
    // Throws Error(io) if the shards were refused.
    virtual void submit(const JobFolder& job, const Submission& submission) = 0;
    // The shards of this job that are queued or running, whoever submitted them. Nothing: it cannot be known
    // now, which says nothing about the shards. Throws Error(not_found) if it never will be.
    virtual std::optional<std::set<int>> poll(const JobFolder& job) = 0;
    // Ends those that are queued or running. Throws Error(io) if that cannot be done now.
    virtual void cancel(const JobFolder& job) = 0;
    // How long the caller waits from poll to poll.
    virtual std::chrono::milliseconds poll_interval() const = 0;
};

struct ExecutorOptions {
    int at_once = 0;  // shards of a submission that run at once; 0: as many as there is room for
    int threads = 1;  // of each shard
};

// "local", "slurm" or the path of a file of command templates (command_template.h). Throws Error about the
// field "--executor", or about a member of the file.
std::unique_ptr<Executor> make_executor(const std::string& which, const ExecutorOptions& options);

}  // namespace gonio
