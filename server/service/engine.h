// What computes the accepted jobs of the store, one after the other, from their checkpoints.
#pragma once
#include <atomic>
#include <functional>
#include <thread>

#include "base/error.h"
#include "measure/plan.h"
#include "server/executor/executor.h"
#include "server/service/job_times.h"
#include "server/service/limits.h"
#include "server/store/store.h"

namespace gonio {

struct EngineOptions {
    RunOptions run;  // checkpoints are the store's
    ServiceLimits limits;
    // Set to compute on other machines (Workplace).
    std::shared_ptr<Executor> executor = {};
    std::string shared_folder = {};
    ShardCommand shard_command = {};
    // After every computation, with how it ended: a status of the job, or "released".
    std::function<void(const std::string& process, const std::string& status, double seconds)> on_end;
};

class Engine {
  public:
    // Starts at once; the store and the times must outlive it.
    Engine(Store& store, JobTimes& times, EngineOptions options);
    // Lets the runs in progress reach their checkpoints no longer than a cancelled run takes (tens of ms to a
    // second), and puts the job back into the queue.
    ~Engine();

  private:
    void work();
    void watch();
    void compute(const ClaimedJob& claimed);
    template <class Ask>
    auto insist(Ask&& ask) -> decltype(ask());
    std::string end_with(const ClaimedJob& claimed, const Error& failure, bool out_of_time);

    Store& store_;
    JobTimes& times_;
    EngineOptions options_;
    std::atomic<bool> ending_{false}, cancel_{false}, out_of_time_{false};
    std::mutex current_mutex_;
    std::string current_hash_;  // of the job being computed; empty between jobs
    std::chrono::steady_clock::time_point current_since_;
    std::thread worker_, watcher_;
};

}  // namespace gonio
