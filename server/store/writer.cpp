#include "server/store/writer.h"

#include <chrono>

#include "base/error.h"
#include "server/store/schema.h"

namespace gonio {
namespace {

constexpr size_t largest_group = 256;
constexpr int checkpoint_pages = 1000;  // 4 MB of log

}  // namespace

Writer::Writer(const std::string& path, Hooks hooks)
    : database_(path, Database::Access::write), hooks_(std::move(hooks)) {
    migrate(database_);
    thread_ = std::thread([this] { serve(); });
}

Writer::~Writer() {
    {
        const std::lock_guard lock(mutex_);
        closing_ = true;
    }
    wake_.notify_one();
    thread_.join();
}

void Writer::enqueue(Request request) {
    {
        const std::lock_guard lock(mutex_);
        if (closing_) throw Error(ErrorCode::internal, "", "", "the store is being closed");
        queue_.push_back(std::move(request));
    }
    wake_.notify_one();
}

void Writer::nudge() {
    const std::lock_guard lock(mutex_);
    nudged_ = true;
    wake_.notify_one();
}

void Writer::serve() {
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [&] { return closing_ || nudged_ || !queue_.empty(); });
        // What is not urgent waits a little for company.
        if (queue_.empty() && nudged_)
            wake_.wait_for(lock, std::chrono::milliseconds(hooks_.nudge_ms),
                           [&] { return closing_ || !queue_.empty(); });
        if (queue_.empty() && !nudged_) return;  // closing
        nudged_ = false;
        std::vector<Request> group = next_group();
        lock.unlock();
        const int64_t changes = database_.total_changes();
        commit(group);
        // Not for a request that found nothing to do: whoever waits for changes may be who asked.
        if (database_.total_changes() != changes) hooks_.after_change();
        for (Request& request : group) request.answer(request.failure);
        // The callers have their answers: they need not wait for this one.
        database_.checkpoint_if_above(checkpoint_pages);
        lock.lock();
    }
}

std::vector<Writer::Request> Writer::next_group() {
    std::vector<Request> group;
    while (!queue_.empty() && group.size() < largest_group) {
        if (queue_.front().alone && !group.empty()) break;
        group.push_back(std::move(queue_.front()));
        queue_.pop_front();
        if (group.back().alone) break;
    }
    return group;
}

void Writer::commit(std::vector<Request>& group) {
    if (commit_together(group) || group.size() < 2) return;
    // A full disk takes the whole transaction with it. What one of them was too large for, the others may
    // pass.
    for (Request& request : group) {
        std::vector<Request> alone;
        alone.push_back(std::move(request));
        alone.front().failure = nullptr;
        commit_together(alone);
        request = std::move(alone.front());
    }
}

// False if nothing was written; every request then has its failure.
bool Writer::commit_together(std::vector<Request>& group) {
    try {
        database_.execute("BEGIN IMMEDIATE");
        for (Request& request : group) {
            database_.execute("SAVEPOINT request");
            try {
                request.work(database_);
            } catch (...) {
                request.failure = std::current_exception();
                if (!database_.in_transaction()) throw;
                database_.execute("ROLLBACK TO request");
            }
            database_.execute("RELEASE request");
        }
        hooks_.before_commit(database_);
        database_.execute("COMMIT");
        return true;
    } catch (...) {
        for (Request& request : group)
            if (!request.failure) request.failure = std::current_exception();
        try {
            if (database_.in_transaction()) database_.execute("ROLLBACK");
        } catch (const Error&) {
            // BEGIN says so the next time, to those whom it concerns.
        }
        return false;
    }
}

}  // namespace gonio
