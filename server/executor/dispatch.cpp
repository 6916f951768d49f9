#include "server/executor/dispatch.h"

#include <algorithm>
#include <map>
#include <thread>

#include "server/checkpoint_folder.h"

namespace gonio {
namespace {

using namespace std::chrono_literals;

// What a shard is not seen in for so many polls has lost it: between two looks it may just have ended.
constexpr int polls_until_lost = 2;

struct WantedShard {
    std::string key;
    int attempts = 0;  // submissions, by whomever
    int unseen = 0;    // polls in a row that did not know it
    bool failed = false;
    // What became of the last attempt.
    std::string fate = "ended and left nothing (killed, lost with its machine, or another version of gonio?)";
};

class Dispatcher {
  public:
    Dispatcher(const JobFolder& job, Executor& executor, Checkpoints& checkpoints, const Monitor& monitor)
        : job_(job), executor_(executor), checkpoints_(checkpoints), monitor_(monitor) {}

    // Returns when all of them are there.
    void compute(const std::vector<Shard>& shards) {
        known_ = std::max(known_, 1 + shards.back().index);
        std::map<int, WantedShard> wanted;
        for (const auto& [index, key] : shards) {
            wanted[index].key = key;
            job_.forget_failure(index);  // of an earlier start
        }
        for (;;) {
            std::erase_if(wanted, [&](const auto& shard) { return checkpoints_.load(shard.second.key); });
            report(wanted.size());
            if (wanted.empty()) return;
            for (auto& [index, shard] : wanted) look_for_failure(index, shard);
            const std::optional<std::set<int>> queued = executor_.poll(job_);
            queue_answers_ = queued.has_value();
            if (queued) submit(due(wanted, *queued), wanted);
            wait();
        }
    }

    double relative_error = 0;  // of the last merge; 0 while unknown

  private:
    void look_for_failure(int index, WantedShard& shard) const {
        const std::optional<ShardFailure> failure = job_.failure(index);
        if (!failure) return;
        const std::string name = "shard " + std::to_string(index);
        shard.fate = "failed with exit code " + std::to_string(failure->exit_code) + ": " + failure->message;
        for (const auto& [exit_code, error] : permanent)
            if (failure->exit_code == exit_code) throw Error(error, name, "", shard.fate);
        job_.forget_failure(index);
        shard.failed = true;
    }

    // Those to be submitted now.
    static std::vector<int> due(std::map<int, WantedShard>& wanted, const std::set<int>& queued) {
        std::vector<int> indices;
        for (auto& [index, shard] : wanted) {
            const bool is_queued = queued.contains(index);
            shard.unseen = is_queued ? 0 : shard.unseen + 1;
            if (is_queued) shard.attempts = std::max(shard.attempts, 1);
            if (shard.failed || (!is_queued && (shard.attempts == 0 || shard.unseen >= polls_until_lost)))
                indices.push_back(index);
        }
        return indices;
    }

    void submit(const std::vector<int>& indices, std::map<int, WantedShard>& wanted) {
        for (size_t first = 0; first < indices.size(); first += max_submission) {
            const size_t n = std::min<size_t>(max_submission, indices.size() - first);
            std::vector<int> part(indices.begin() + static_cast<long>(first),
                                  indices.begin() + static_cast<long>(first + n));
            for (const int index : part) {
                WantedShard& shard = wanted[index];
                if (++shard.attempts > most_attempts)
                    throw Error(ErrorCode::io, "shard " + std::to_string(index), "",
                                "was tried " + std::to_string(most_attempts) + " times; it " + shard.fate);
                shard.unseen = 0;
                shard.failed = false;
            }
            try {
                executor_.submit(job_, job_.new_submission(part));
                refusals_ = 0;
            } catch (const Error& error) {
                // It may have been taken all the same (a time-out), so only the next polls can tell.
                if (error.code() != ErrorCode::io || ++refusals_ >= most_attempts) throw;
                for (const int index : part) --wanted[index].attempts;
            }
        }
    }

    void report(size_t n_missing) const {
        const std::string stage =
            queue_answers_ ? std::to_string(n_missing) + " shards on their way" : "the queue does not answer";
        monitor_.report(
            {static_cast<double>(known_ - static_cast<int>(n_missing)) / known_, stage, relative_error});
    }

    void wait() const {
        const auto end = std::chrono::steady_clock::now() + executor_.poll_interval();
        while (std::chrono::steady_clock::now() < end) {
            monitor_.check_cancelled();
            std::this_thread::sleep_for(std::min<std::chrono::milliseconds>(executor_.poll_interval(), 50ms));
        }
    }

    // Exit codes of `gonio shard` that no other machine would change, and what they mean.
    static constexpr std::pair<int, ErrorCode> permanent[] = {
        {2, ErrorCode::usage}, {3, ErrorCode::invalid_input}, {6, ErrorCode::limit}};

    const JobFolder& job_;
    Executor& executor_;
    Checkpoints& checkpoints_;
    const Monitor& monitor_;
    int known_ = 0;  // shards that the job is known to have
    int refusals_ = 0;
    bool queue_answers_ = true;
};

// Why it could not be done; empty if it was.
std::string cancel(Executor& executor, const JobFolder& job) {
    try {
        executor.cancel(job);
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

}  // namespace

bool can_be_dispatched(const LoadedJob& loaded) {
    const auto* plan = std::get_if<BrdfPlan>(&loaded.job.plan);
    return plan && !plan->accuracy.max_seconds;
}

BrdfResult dispatch(const LoadedJob& loaded, const JobFolder& job, Executor& executor, RunOptions options,
                    const Monitor& monitor, const std::atomic<bool>* keep_queued) {
    if (!std::holds_alternative<BrdfPlan>(loaded.job.plan))
        throw Error(ErrorCode::invalid_input, "/measure/kind", "",
                    "only brdf jobs are cut into shards: gonio run");
    if (!can_be_dispatched(loaded))
        throw Error(ErrorCode::invalid_input, "/accuracy/max_seconds", "",
                    "cannot be kept by shards on many machines: ask for a target_relative_error");
    CheckpointFolder checkpoints(job.shared(), job.job_hash());
    options.checkpoints = &checkpoints;
    options.shard_task = {ShardTask::Kind::compute_none, 0};
    Dispatcher dispatcher(job, executor, checkpoints, monitor);
    Monitor merging;
    merging.cancel_requested = monitor.cancel_requested;
    merging.on_progress = [&](const Progress& progress) {
        dispatcher.relative_error = progress.relative_error;
    };
    try {
        for (;;) {
            try {
                BrdfResult result = run_brdf(loaded, options, merging);
                cancel(executor, job);  // shards that were thought lost, and run twice
                return result;
            } catch (const MissingShards& missing) {
                dispatcher.compute(missing.shards());
            }
        }
    } catch (const Error& error) {
        if (keep_queued && *keep_queued) throw;
        const std::string left = cancel(executor, job);
        if (left.empty()) throw;
        throw Error(error.code(), error.field(), error.value(),
                    error.allowed() + "; shards may still run: " + left);
    }
}

}  // namespace gonio
