// The one thread that writes the database. Several threads with a connection each would fight for the lock
// with random waits: measured on a prototype, one that accepts starves those that finish 70 to 1.
#pragma once
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <type_traits>
#include <vector>

#include "server/store/sqlite.h"

namespace gonio {

class Writer {
  public:
    // Both in the writer's thread: before_commit in the transaction of every group, after_change when one
    // that changed something is durable.
    struct Hooks {
        std::function<void(Database&)> before_commit;
        std::function<void()> after_change;
        int nudge_ms = 250;
    };
    Writer(const std::string& path, Hooks hooks);
    ~Writer();  // after everything queued has been answered

    // Queues work(database). Whatever is queued at one time shares one transaction and one sync; the future
    // is ready when that is durable. `work` may run twice (its neighbours' trouble): it changes the database
    // and nothing else.
    template <class Work>
    auto submit(Work work) {
        return enqueue_work(std::move(work), false);
    }
    template <class Work>
    auto run(Work work) {
        return enqueue_work(std::move(work), false).get();
    }
    // In a transaction of its own: `work` sees nothing that a neighbour's failure could still undo. For what
    // the database cannot take back, such as removing files.
    template <class Work>
    auto run_alone(Work work) {
        return enqueue_work(std::move(work), true).get();
    }

    // Has before_commit run with the next group, or alone if none comes for nudge_ms.
    void nudge();

  private:
    struct Request {
        std::function<void(Database&)> work;
        std::function<void(std::exception_ptr)> answer;
        bool alone;
        std::exception_ptr failure;
    };
    template <class Work>
    auto enqueue_work(Work work, bool alone) {
        using Result = std::invoke_result_t<Work, Database&>;
        auto promise = std::make_shared<std::promise<Result>>();
        auto result = std::make_shared<std::optional<Result>>();
        auto future = promise->get_future();
        enqueue({[work = std::move(work), result](Database& database) { *result = work(database); },
                 [promise, result](std::exception_ptr failure) {
                     failure ? promise->set_exception(failure) : promise->set_value(std::move(**result));
                 },
                 alone, nullptr});
        return future;
    }
    void enqueue(Request request);
    void serve();
    void commit(std::vector<Request>& group);
    std::vector<Request> next_group();
    bool commit_together(std::vector<Request>& group);

    Database database_;
    Hooks hooks_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<Request> queue_;
    bool nudged_ = false;
    bool closing_ = false;
    std::thread thread_;  // last: it uses all of the above
};

}  // namespace gonio
