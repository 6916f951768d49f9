// Shards as child processes of this one.
#pragma once
#include <sys/types.h>

#include <deque>
#include <map>

#include "server/executor/executor.h"

namespace gonio {

// At most at_once of them run at the same time (0: one for each processor, divided by the threads of a
// shard).
class LocalExecutor : public Executor {
  public:
    explicit LocalExecutor(const ExecutorOptions& options);
    LocalExecutor(const LocalExecutor&) = delete;
    LocalExecutor& operator=(const LocalExecutor&) = delete;
    // Ends what is running. Children of a killed process go on, and end with their shard.
    ~LocalExecutor() override;

    void submit(const JobFolder& job, const Submission& submission) override;
    std::optional<std::set<int>> poll(const JobFolder& job) override;
    void cancel(const JobFolder& job) override;
    std::chrono::milliseconds poll_interval() const override { return std::chrono::milliseconds(20); }

  private:
    void end_all();

    size_t at_once_;
    std::string script_;
    std::deque<int> waiting_;
    std::map<pid_t, int> running_;  // leaders of process groups, and their shards
};

}  // namespace gonio
