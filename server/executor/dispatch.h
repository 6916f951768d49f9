// A job computed shard by shard through an executor, until the table can be put together.
#pragma once
#include "server/executor/executor.h"

namespace gonio {

inline constexpr int most_attempts = 3;  // submissions of one shard

// The result of run_brdf(), bit for bit. Which shards are needed depends on what the first ones measured, so
// it merges, submits what is missing, waits and merges again. What `job` holds already, and what the executor
// has still queued from an earlier start, is not submitted again. One dispatch() a job and folder at a time.
//
// options: max_bytes and allow_skips as in the JobFolder; n_threads of the merge. Checkpoints and shard_task
// are set here. Shards that are left when it ends, also by an exception, are cancelled - unless `keep_queued`
// is set by then: a service that stops finds them again when it is started.
//
// Throws Error: cancelled; invalid_input for a job that can_be_dispatched() does not take; what a
// shard failed with if trying again is no use (exit codes 2, 3, 6); io after most_attempts failures or
// disappearances of one shard, or as many refused submissions in a row.
BrdfResult dispatch(const LoadedJob& loaded, const JobFolder& job, Executor& executor, RunOptions options,
                    const Monitor& monitor = {}, const std::atomic<bool>* keep_queued = nullptr);

// Whether shards can compute it at all: not a job with max_seconds, whose clock no shard can read, and no
// other kind than brdf.
bool can_be_dispatched(const LoadedJob& loaded);

}  // namespace gonio
