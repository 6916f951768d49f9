// How long jobs take, for an honest Retry-After.
#pragma once
#include <atomic>

namespace gonio {

class JobTimes {
  public:
    void record(double seconds) {
        const double before = mean_seconds_;
        mean_seconds_ = before == 0 ? seconds : 0.8 * before + 0.2 * seconds;  // one thread records
    }
    // Moving mean of the last few jobs; 0 before the first.
    double mean_seconds() const { return mean_seconds_; }

  private:
    std::atomic<double> mean_seconds_{0};
};

}  // namespace gonio
