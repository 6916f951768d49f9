// The durable store under the service: jobs, results, surfaces. What a call has returned survives the end of
// the process and of the machine's power (README.md: what survives what). It knows nothing of HTTP and
// nothing of how a job is computed: clients speak in job ids, the engine in job hashes, and equal hashes
// share one computation and one result.
#pragma once
#include <chrono>
#include <condition_variable>
#include <memory>
#include <set>

#include "server/store/records.h"
#include "server/store/writer.h"

namespace gonio {

struct StoreOptions {
    std::string folder;                 // made if missing; on a local disk (SQLite's log needs shared memory)
    std::function<int64_t()> now = {};  // ms since the epoch; empty: the system's clock
    // Computations of a job that may end with the process or an error of the disk, without a new checkpoint.
    int max_attempts = 20;
};

// Any thread may call anything. Errors of the disk are Error(io) naming the folder or the file; the store
// stays usable after them. A failed fsync is not survived: the process aborts (files.h).
class Store {
  public:
    // Takes the folder for itself, or throws Error(io). Jobs that were running go back into the queue, to be
    // computed on from their checkpoints; those that took the process down max_attempts times fail.
    explicit Store(const StoreOptions& options);
    ~Store();
    Store(const Store&) = delete;
    Store& operator=(const Store&) = delete;

    // ---- clients

    // Durable on return. Where results for the job_hash exist the job is successful at once. Throws
    // Error(not_found) for a surface that is not there.
    Acceptance accept(const NewJob& job);
    std::optional<StoredJob> find(const std::string& id);
    std::optional<std::string> document(const std::string& id);
    // Newest first.
    std::vector<StoredJob> list(const JobFilter& filter);
    Dismissal dismiss(const std::string& id);
    StoreCounts counts();
    // By name; empty if there are none (any more).
    std::vector<ResultOutput> results(const std::string& job_hash);

    // Counts what has been committed. Returns once it differs from `seen`, or after the time: a stream of
    // events looks at its job, waits, looks again.
    uint64_t changes() const;
    uint64_t wait_for_change(uint64_t seen, std::chrono::milliseconds timeout) const;

    // ---- the engine

    // The oldest job whose hash nobody computes, now running; one that took the process down three times
    // waits for the others. An equal job waits for that one's end and shares it.
    std::optional<ClaimedJob> next_job();
    // To be seen soon, not at once, and not durable. relative_error_ppb: reached so far, 0 while unknown.
    void progress(const std::string& job_hash, int percent, const std::string& message,
                  int64_t relative_error_ppb = 0);
    bool stop_requested(const std::string& job_hash);
    // Ends all jobs of the hash.
    void succeed(const std::string& job_hash, const std::vector<NewOutput>& outputs);
    void fail(const std::string& job_hash, const std::string& message, const std::string& problem);
    // The engine has stopped because it was asked to.
    void stopped(const std::string& job_hash);
    // Back into the queue, without counting the attempt: an orderly shutdown.
    void release(const std::string& job_hash);
    // Back into the queue after an error of the disk; the attempt counts. False, and nothing done, if it was
    // the last one.
    bool try_again(const std::string& job_hash);

    // Parts of a computation, found again after a crash and by later jobs of the same runs_hash. They stay
    // until gc needs their room. An equal key is replaced.
    void save_checkpoint(const std::string& job_hash, const std::string& runs_hash, const std::string& key,
                         const StoredObject& object);
    std::optional<Checkpoint> load_checkpoint(const std::string& runs_hash, const std::string& key);
    std::vector<Checkpoint> checkpoints(const std::string& runs_hash);

    // ---- objects and surfaces

    const std::string& folder() const { return folder_; }
    // Why the disk takes nothing more, as long as that is so; empty otherwise.
    std::string no_room() const;
    Objects& objects() { return objects_; }
    void put_surface(const StoredObject& object);
    bool has_surface(const std::string& sha256);
    // For the order of eviction; not durable.
    void touch_surface(const std::string& sha256);
    void touch_results(const std::string& job_hash);

    // ---- upkeep

    // Removes the least recently used results and surfaces until the rest fits the quota, except what
    // unfinished jobs need, then every object to which no row points.
    GcReport gc(int64_t quota_bytes);
    // Deep: reads every object and compares its SHA-256.
    StoreCheck check(bool deep);
    // The document (document.json), the outputs under their names, and a SHA256SUMS of them, into an existing
    // or new folder. Throws Error(not_found).
    void export_job(const std::string& id, const std::string& folder);

  private:
    struct Pending {
        struct Progress {
            int percent;
            std::string message;
            std::optional<int64_t> relative_error_ppb;
        };
        std::map<std::string, Progress> progress;
        std::set<std::string> surfaces, results;
    };
    int64_t now() const { return now_(); }
    void recover();
    void write_pending(Database& database);

    std::function<int64_t()> now_;
    int max_attempts_;
    std::string folder_;
    FolderLock lock_;
    Objects objects_;
    Readers readers_;

    mutable std::mutex changes_mutex_;
    mutable std::condition_variable changed_;
    uint64_t changes_ = 0;

    std::mutex pending_mutex_;
    Pending pending_;

    Writer writer_;  // last: its thread uses all of the above
};

}  // namespace gonio
