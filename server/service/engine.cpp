#include "server/service/engine.h"

#include <cmath>
#include <fstream>
#include <iterator>

#include "base/text.h"
#include "server/result_json.h"
#include "server/service/processes.h"

namespace gonio {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto between_upkeeps = 10min;
// To a disk that is full, or failed.
constexpr auto between_looks = 500ms, before_next_attempt = 1000ms;

// A file of ours that could not be read or written. (The errors of executors name no file.)
bool is_of_the_disk(const Error& error) {
    return error.code() == ErrorCode::io && error.field().starts_with('/');
}

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

// Checkpoints of one job in the store, and those of its equals but for the target.
class StoredCheckpoints : public Checkpoints {
  public:
    StoredCheckpoints(Store& store, const PreparedJob& job)
        : store_(store), job_hash_(job.job_hash), runs_hash_(job.runs_hash) {}
    std::optional<std::string> load(const std::string& key) override {
        const std::optional<Checkpoint> saved = store_.load_checkpoint(runs_hash_, key);
        if (!saved) return std::nullopt;
        std::ifstream in(store_.objects().path(saved->sha256), std::ios::binary);
        std::string bytes{std::istreambuf_iterator<char>(in), {}};
        // A damaged file is computed again.
        if (sha256_hex(bytes) != saved->sha256) return std::nullopt;
        return bytes;
    }
    void save(const std::string& key, const std::string& bytes) override {
        store_.save_checkpoint(job_hash_, runs_hash_, key, store_.objects().put(bytes));
    }

  private:
    Store& store_;
    std::string job_hash_, runs_hash_;
};

PreparedJob prepare(const ClaimedJob& claimed, Objects& objects) {
    const ServiceProcess* process = find_process(claimed.job.process);
    if (!process)
        throw Error(ErrorCode::invalid_input, "process", claimed.job.process,
                    "this program does not have it");
    return process->prepare(nlohmann::json::parse(claimed.document), objects);
}

}  // namespace

Engine::Engine(Store& store, JobTimes& times, EngineOptions options)
    : store_(store),
      times_(times),
      options_(std::move(options)),
      worker_([this] { work(); }),
      watcher_([this] { watch(); }) {}

Engine::~Engine() {
    ending_ = true;
    cancel_ = true;
    worker_.join();
    watcher_.join();
}

void Engine::work() {
    uint64_t seen = store_.changes();
    while (!ending_) {
        std::optional<ClaimedJob> claimed;
        // What was accepted waits for room.
        if (store_.no_room().empty()) claimed = insist([&] { return store_.next_job(); });
        if (claimed)
            compute(*claimed);
        else
            seen = store_.wait_for_change(seen, between_looks);
    }
}

// The store's word, once the disk takes it.
template <class Ask>
auto Engine::insist(Ask&& ask) -> decltype(ask()) {
    for (;;) {
        try {
            return ask();
        } catch (const std::exception&) {
            if (ending_) return {};  // the next start finds the job as a crash would leave it
            std::this_thread::sleep_for(between_looks);
        }
    }
}

// A running job that is dismissed must end within a second, one that is out of time at once. And what is
// beyond the quota goes.
void Engine::watch() {
    Clock::time_point next_upkeep = Clock::now();
    while (!ending_) {
        std::this_thread::sleep_for(100ms);
        try {
            {
                const std::lock_guard lock(current_mutex_);
                if (!current_hash_.empty()) {
                    if (store_.stop_requested(current_hash_)) cancel_ = true;
                    if (seconds_since(current_since_) > options_.limits.job_seconds)
                        out_of_time_ = cancel_ = true;
                }
            }
            if (Clock::now() < next_upkeep) continue;
            next_upkeep = Clock::now() + between_upkeeps;
            static_cast<void>(store_.gc(options_.limits.stored_bytes));
        } catch (const Error&) {  // the disk: once more, next time
        }
    }
}

void Engine::compute(const ClaimedJob& claimed) {
    const std::string& hash = claimed.job.job_hash;
    const Clock::time_point began = Clock::now();
    {
        const std::lock_guard lock(current_mutex_);
        current_hash_ = hash;
        current_since_ = began;
        out_of_time_ = false;
        cancel_ = ending_.load();
    }
    Monitor monitor;
    monitor.cancel_requested = &cancel_;
    monitor.on_progress = [&](const Progress& progress) {
        store_.progress(hash, std::clamp(static_cast<int>(100 * progress.fraction), 0, 99), progress.stage,
                        std::llround(1e9 * std::min(progress.relative_error, 1e3)));
    };
    std::optional<Error> failure;
    try {
        const PreparedJob job = prepare(claimed, store_.objects());
        StoredCheckpoints checkpoints(store_, job);
        Workplace place{store_.objects(),       options_.run,           monitor, options_.executor.get(),
                        options_.shared_folder, options_.shard_command, &ending_};
        place.options.checkpoints = &checkpoints;
        store_.succeed(hash, job.run(place));
    } catch (const Error& error) {
        failure = error;
    } catch (const std::bad_alloc&) {
        failure = Error(ErrorCode::limit, "", "", "out of memory");
    } catch (const std::exception& error) {
        failure = Error(ErrorCode::internal, "", "", error.what());
    }
    {
        const std::lock_guard lock(current_mutex_);
        current_hash_.clear();
    }
    const std::string status =
        failure ? insist([&] { return end_with(claimed, *failure, out_of_time_); }) : "successful";
    const double seconds = seconds_since(began);
    times_.record(seconds);
    if (options_.on_end) options_.on_end(claimed.job.process, status, seconds);
}

std::string Engine::end_with(const ClaimedJob& claimed, const Error& failure, bool out_of_time) {
    const std::string& hash = claimed.job.job_hash;
    auto failed = [&](const Error& error) {
        store_.fail(hash, error.what(), failure_json(error, {-1, ""}));
        return "failed";
    };
    if (is_of_the_disk(failure) && store_.try_again(hash)) {
        std::this_thread::sleep_for(before_next_attempt);
        return "released";
    }
    if (failure.code() != ErrorCode::cancelled) return failed(failure);
    if (store_.stop_requested(hash)) {
        store_.stopped(hash);
        return "dismissed";
    }
    if (out_of_time)
        return failed({ErrorCode::limit, "", "",
                       "took longer than the " + number_text(options_.limits.job_seconds) +
                           " s that this service allows a job"});
    store_.release(hash);
    return "released";
}

}  // namespace gonio
