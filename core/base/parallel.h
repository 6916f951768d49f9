// Threads on std::thread alone, so that ThreadSanitizer sees every one of ours (TBB stays Embree's own).
#pragma once
#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace gonio {

// Runs task(i) for i in [0, n_tasks) on n_threads threads, in any order. The caller fixes the partition: a
// task may write only what belongs to its own i, and whoever reduces does so in the order of i. That, and not
// luck, gives the same bits on any number of threads. The first exception stops the hand-out of tasks and is
// thrown again here.
template <class Task>
void parallel_for(int n_tasks, int n_threads, Task&& task) {
    n_threads = std::min(n_threads, n_tasks);
    if (n_threads <= 1) {
        for (int i = 0; i < n_tasks; ++i) task(i);
        return;
    }
    std::atomic<int> next{0};
    std::exception_ptr failure;
    std::mutex failure_mutex;
    auto work = [&] {
        for (int i = next.fetch_add(1); i < n_tasks; i = next.fetch_add(1)) {
            try {
                task(i);
            } catch (...) {
                const std::lock_guard lock(failure_mutex);
                if (!failure) failure = std::current_exception();
                next.store(n_tasks);
            }
        }
    };
    std::vector<std::jthread> threads;
    threads.reserve(n_threads - 1);
    for (int t = 1; t < n_threads; ++t) threads.emplace_back(work);
    work();
    threads.clear();
    if (failure) std::rethrow_exception(failure);
}

}  // namespace gonio
