// The store under load, for the tests that kill it, cut its power and fail its system calls: acceptors submit
// jobs 0, 1, 2... under their keys, workers compute pseudo results in parts, each a checkpoint. What the
// store has promised is said on stdout, in lines written at once:
//   ACK key id            accept() has returned
//   DONE job_hash sha256  succeed() has returned
//
// Usage: store_driver FOLDER accept FIRST COUNT | work | sequence FIRST COUNT | both FIRST COUNT | verify |
// commits COUNT
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>

#include "base/error.h"
#include "server/store/store.h"

namespace {

using namespace gonio;

constexpr int parts = 3;
constexpr int64_t no_quota = int64_t{1} << 60;

std::atomic<bool> trouble{false};

void say(const std::string& line) {
    const std::string text = line + "\n";
    if (::write(STDOUT_FILENO, text.data(), text.size()) < 0) std::_Exit(9);
}

// Half of the neighbours have equal hashes: one is computed, the other follows.
NewJob job_number(int64_t n) {
    NewJob job;
    job.process = "brdf";
    job.document = "{\"number\":" + std::to_string(n / 2) + ",\"text\":\"" + std::string(2000, 'x') + "\"}";
    job.job_hash = job.runs_hash = sha256_hex(job.document);
    job.owner = n % 3 ? "anna" : "";
    job.idempotency_key = "key-" + std::to_string(n);
    job.request_hash = sha256_hex("request " + std::to_string(n));
    return job;
}

std::string pseudo_part(const std::string& job_hash, int part) {
    std::seed_seq seed(job_hash.begin(), job_hash.end());
    std::mt19937_64 random(seed);
    random.discard(static_cast<unsigned>(part) * 1000);
    std::string bytes(4096 + random() % 32768, '\0');
    for (char& c : bytes) c = static_cast<char>(random() >> 32);
    return bytes;
}

std::string read_object(Store& store, const std::string& sha256) {
    const OpenObject object = store.objects().open(sha256);
    std::string bytes(static_cast<size_t>(object.bytes), '\0');
    if (::pread(object.file.get(), bytes.data(), bytes.size(), 0) != object.bytes) return "unreadable";
    return bytes;
}

// The result is made of what the checkpoints hold, not of what was just computed: a bad one would show.
void compute(Store& store, const std::string& job_hash) {
    std::string whole;
    for (int part = 0; part < parts; ++part) {
        const std::string key = "part " + std::to_string(part);
        if (!store.load_checkpoint(job_hash, key))
            store.save_checkpoint(job_hash, job_hash, key, store.objects().put(pseudo_part(job_hash, part)));
        whole += read_object(store, store.load_checkpoint(job_hash, key)->sha256);
        store.progress(job_hash, 100 * (part + 1) / parts, key);
    }
    const StoredObject table = store.objects().put(whole);
    const StoredObject report = store.objects().put("{\"job_hash\":\"" + job_hash + "\"}");
    store.succeed(job_hash, {{"table.bin", "application/octet-stream", table},
                             {"report.json", "application/json", report}});
    say("DONE " + job_hash + " " + table.sha256);
}

// An error is met once more; a second one is trouble, and ends the thread.
template <class Action>
bool insist(Action&& action) {
    for (int attempt = 0; attempt < 2; ++attempt) {
        try {
            action();
            return true;
        } catch (const Error& error) {
            std::fprintf(stderr, "store_driver: %s\n", error.what());
        }
    }
    trouble = true;
    return false;
}

void accept_jobs(Store& store, int64_t first, int64_t count, int64_t step) {
    for (int64_t n = first; n < first + count; n += step) {
        const NewJob job = job_number(n);
        if (!insist([&] { say("ACK " + *job.idempotency_key + " " + store.accept(job).job.id); })) return;
    }
}

// Until the queue is empty and nobody adds to it.
void work(Store& store, const std::atomic<bool>& accepting) {
    for (bool good = true; good;) {
        const bool last = !accepting;
        const uint64_t seen = store.changes();
        std::optional<ClaimedJob> claimed;
        good = insist([&] { claimed = store.next_job(); });
        if (claimed)
            good = insist([&] { compute(store, claimed->job.job_hash); });
        else if (last)
            return;
        else
            store.wait_for_change(seen, std::chrono::milliseconds(20));
    }
}

void run_together(Store& store, int64_t first, int64_t count) {
    std::atomic<bool> accepting{true};
    std::vector<std::thread> workers, acceptors;
    for (int k = 0; k < 2; ++k) workers.emplace_back([&] { work(store, accepting); });
    for (int k = 0; k < 2; ++k)
        acceptors.emplace_back([&, k] { accept_jobs(store, first + k, count - k, 2); });
    // Not at every run: what an interrupted writer left is to be met by the next one as well.
    if (std::random_device{}() % 4 == 0) insist([&] { store.gc(no_quota); });
    for (std::thread& thread : acceptors) thread.join();
    accepting = false;
    for (std::thread& thread : workers) thread.join();
}

int verify(Store& store) {
    const StoreCheck check = store.check(true);
    for (const std::string& fault : check.faults) say("FAULT " + fault);
    say("CHECKED rows " + std::to_string(check.rows) + " objects " + std::to_string(check.objects) +
        " orphans " + std::to_string(check.orphans));
    return check.faults.empty() ? 0 : 1;
}

void measure_commits(Store& store, int64_t count) {
    for (const int threads : {1, 8}) {
        const auto start = std::chrono::steady_clock::now();
        std::vector<std::thread> acceptors;
        for (int k = 0; k < threads; ++k)
            acceptors.emplace_back([&, k] {
                for (int64_t n = k; n < count; n += threads) {
                    NewJob job = job_number(n);
                    job.idempotency_key.reset();
                    store.accept(job);
                }
            });
        for (std::thread& thread : acceptors) thread.join();
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        say(std::to_string(threads) + " threads: " +
            std::to_string(static_cast<int>(static_cast<double>(count) / seconds.count())) + " accepted/s");
    }
}

int run(const std::string& folder, const std::string& mode, int64_t first, int64_t count) {
    StoreOptions options{folder};
    options.max_attempts = 1 << 30;  // the tests kill more often than any computation would
    Store store(options);
    std::atomic<bool> nobody{false};
    if (mode == "verify") return verify(store);
    if (mode == "commits") measure_commits(store, first);
    if (mode == "accept" || mode == "sequence") accept_jobs(store, first, count, 1);
    if (mode == "work" || mode == "sequence") work(store, nobody);
    if (mode == "both") run_together(store, first, count);
    return trouble ? 4 : 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    try {
        return run(argv[1], argv[2], argc > 3 ? std::atoll(argv[3]) : 0, argc > 4 ? std::atoll(argv[4]) : 0);
    } catch (const Error& error) {
        std::fprintf(stderr, "store_driver: %s\n", error.what());
        return 3;
    }
}
