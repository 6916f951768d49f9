// What the store keeps, as its users see it. Times are ms since the epoch, UTC.
#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/objects.h"

namespace gonio {

enum class JobStatus { accepted, running, successful, failed, dismissed };

// As in OGC API - Processes and in the table.
std::string_view status_name(JobStatus status);
// Throws Error(invalid_input) for any other text.
JobStatus status_named(std::string_view name);

struct NewJob {
    std::string process;                         // "brdf"
    std::string document;                        // the canonical job, as accepted
    std::string job_hash;                        // equal hash: equal result, computed once
    std::string runs_hash;                       // under which its checkpoints are; jobs may share them
    std::string owner;                           // name of the token; may be empty
    std::optional<std::string> idempotency_key;  // unique per owner
    std::string request_hash;                    // of the request that came with the key
    std::vector<std::string> surfaces;           // SHA-256 of the surfaces that it reads
    std::string message;
};

struct StoredJob {
    int64_t sequence;  // in the order of acceptance; the cursor of a list
    std::string id;    // 128 random bits in hex
    std::string process, job_hash, owner;
    JobStatus status;
    std::string message;
    int progress;                               // 0..100
    std::optional<int64_t> relative_error_ppb;  // of its table so far, in units of 1e-9
    int64_t created;
    std::optional<int64_t> started, finished;
    int64_t updated;
    std::optional<int64_t> expires;      // since when its results are gone
    int64_t version;                     // grows with every change that can be seen
    int attempts;                        // how often its computation was begun
    bool stop_requested;                 // dismissed while running: the engine is to stop
    std::optional<std::string> problem;  // JSON text, if it failed
};

struct Acceptance {
    enum class Outcome {
        created,
        repeated,      // the same request came with the same key before: `job` is that one
        key_conflict,  // another request came with the same key: `job` is the one it made
    };
    Outcome outcome;
    StoredJob job;
};

struct ClaimedJob {
    StoredJob job;
    std::string document;
};

enum class Dismissal {
    not_found,
    dismissed,  // done; where it was running, an equal job took the computation over
    stopping,   // flagged: dismissed once the engine says stopped(job_hash)
    finished,   // it had ended before; nothing was changed
};

// An output on its way in. The name becomes a file's name: letters, digits, '.', '_', '-'.
struct NewOutput {
    std::string name, media_type;
    StoredObject object;
};

struct ResultOutput {
    std::string name, media_type, sha256;
    int64_t bytes, created, last_used;
};

struct Checkpoint {
    std::string key, sha256;
    int64_t bytes;
};

struct JobFilter {
    std::vector<JobStatus> statuses;  // empty: any
    std::optional<std::string> process, owner;
    std::optional<int64_t> created_from, created_to;  // both ends included
    std::optional<int64_t> min_duration_ms,
        max_duration_ms;  // of jobs that were started; running ones: so far
    int64_t limit = 10;
    std::optional<int64_t> after;  // sequence of the last job of the page before
};

struct QueueLength {
    int64_t queued = 0, running = 0;
};

struct StoreCounts {
    QueueLength all;
    std::map<std::string, QueueLength> by_owner;
};

struct GcReport {
    int64_t bytes_before = 0, bytes_after = 0;  // of all that is kept, equal objects counted once
    int64_t checkpointed = 0;                   // computations whose checkpoints were removed
    int64_t results = 0, surfaces = 0;          // removed
    int64_t objects = 0;                        // files removed
};

struct StoreCheck {
    std::vector<std::string> faults;   // empty: all is well
    int64_t rows = 0;                  // that point to objects
    int64_t objects = 0, orphans = 0;  // an orphan, to which no row points, is no fault
};

}  // namespace gonio
