// How long work tells its caller how far it is, and learns that it should stop. core never prints.
#pragma once
#include <atomic>
#include <functional>
#include <string>

#include "base/error.h"

namespace gonio {

struct Progress {
    double fraction = 0;        // of the work that is planned now, 0..1
    std::string stage;          // "marching", "path tracing", ...
    double relative_error = 0;  // reached so far; 0 while unknown
};

class Monitor {
  public:
    std::function<void(const Progress&)> on_progress;     // called from one thread at a time; may be empty
    const std::atomic<bool>* cancel_requested = nullptr;  // may be null

    void report(const Progress& progress) const {
        check_cancelled();
        if (on_progress) on_progress(progress);
    }
    bool cancelled() const { return cancel_requested && cancel_requested->load(std::memory_order_relaxed); }
    void check_cancelled() const {
        if (cancelled()) throw Error(ErrorCode::cancelled, "", "", "cancelled by the user");
    }
};

}  // namespace gonio
