// What computes the accepted jobs of the store, one after the other, from their checkpoints.
#pragma once
#include <atomic>
#include <thread>

#include "server/run_job.h"
#include "server/store/store.h"

namespace gonio {

struct EngineOptions {
    int n_threads = 1;
    long long max_bytes = 6LL << 30;
};

class Engine {
  public:
    // Starts at once; the store must outlive it.
    Engine(Store& store, const EngineOptions& options);
    // Lets the runs in progress reach their checkpoints no longer than a cancelled run takes (tens of ms to a
    // second), and puts the job back into the queue.
    ~Engine();

  private:
    void work();
    void watch();
    void compute(const ClaimedJob& claimed);

    Store& store_;
    EngineOptions options_;
    std::atomic<bool> ending_{false}, cancel_{false};
    std::mutex current_mutex_;
    std::string current_hash_;  // of the job being computed; empty between jobs
    std::thread worker_, watcher_;
};

// The job document that a store keeps: members surface, material, measure, accuracy of the request. A surface
// {"sha256": ...} is read from `objects`; files of the server are refused. `reference` as in load_job: a
// member "reference": {"paths": n} of the document. Throws Error with pointers into the document.
struct ServiceJob {
    LoadedJob loaded;
    std::vector<std::string> surfaces;  // SHA-256 of what it reads
};
ServiceJob load_service_job(const std::string& document, Objects& objects);

}  // namespace gonio
