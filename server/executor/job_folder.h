// The folder SHARED/<job_hash> of one job, on a disk that all machines share. Beside the finished shards
// (checkpoint_folder.h) lies all that computes them, in dispatch/:
//   job.json, input-*   the job document and copies of the files it names
//   run                 a script that computes one shard: `run INDEX`, or `run LIST LINE`
//   submission-K        the K-th list of shards handed to an executor, a number a line
//   failed-I            shard I failed: the exit code, and below it what it said
//   log-*               what the tasks wrote
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "server/run_job.h"

namespace gonio {

// Shards handed over together. At most max_submission of them: Slurm's default MaxArraySize.
struct Submission {
    int attempt = 0;           // numbers the submissions of a job, from 1
    std::vector<int> indices;  // of the shards; indices[k] stands in line k + 1 of the list
};
inline constexpr int max_submission = 1000;

struct ShardFailure {
    int exit_code = 0;
    std::string message;
};

// How a machine computes a shard.
struct ShardCommand {
    std::string program;  // gonio, as it is called there
    int threads = 1;
    bool untrusted = false;  // its files are strangers': what may harm is decoded in a process of its own
};

class JobFolder {
  public:
    // Writes job.json, the inputs and the script; what is there of an earlier start stays. `document` is the
    // text of the job; files that it names are looked up in `origin_folder`. `options`: max_bytes and
    // allow_skips, which must be the same for every shard. Throws Error(io), Error(not_found).
    JobFolder(const std::string& shared, const LoadedJob& job, const std::string& document,
              const std::string& origin_folder, const ShardCommand& command, const RunOptions& options);

    const std::string& shared() const { return shared_; }  // absolute
    const std::string& job_hash() const { return job_hash_; }
    // "gonio-" and the first 12 digits of the hash: what the tasks are called, followed by "-<attempt>".
    std::string name() const { return "gonio-" + job_hash_.substr(0, 12); }
    std::string job() const { return shared_ + "/" + job_hash_; }  // this folder
    std::string dispatch() const { return job() + "/dispatch"; }
    std::string document() const { return dispatch() + "/job.json"; }
    std::string script() const { return dispatch() + "/run"; }
    std::string list(int attempt) const { return dispatch() + "/submission-" + std::to_string(attempt); }

    // Writes the list of a new submission, numbered behind all that are there.
    Submission new_submission(const std::vector<int>& indices) const;
    // Of a submission that somebody may have made before; empty if there is none.
    std::vector<int> submitted(int attempt) const;

    std::optional<ShardFailure> failure(int index) const;
    void forget_failure(int index) const;

  private:
    std::string shared_, job_hash_;
};

}  // namespace gonio
