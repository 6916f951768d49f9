// When a picture has had runs enough: the one rule of BTFs, light fields, maps and relit reliefs. Tables have
// stages and plan ahead (planning.h).
#pragma once
#include <algorithm>
#include <chrono>

#include "measure/plan.h"

namespace gonio {

class RunLimit {
  public:
    // Counts time from now on. time_share: of max_seconds, what runs may take of it. The reference must
    // outlive it.
    RunLimit(const Accuracy& accuracy, int fewest, int most, double time_share = 1)
        : accuracy_(accuracy), fewest_(fewest), most_(most), time_share_(time_share) {}

    // As many as are asked for; else until the target is met, or one more of their length would be too long.
    bool wants_more(int runs, double relative_error) const {
        if (accuracy_.samples) return runs < accuracy_.samples->replicates;
        if (runs < fewest_) return true;
        if (accuracy_.max_seconds && seconds() * (runs + 1) / runs > time_share_ * *accuracy_.max_seconds)
            return false;
        return relative_error > accuracy_.target() && runs < most_;
    }
    // How far they are, 0 to 1; of an open number as if the next were the last.
    double fraction(int runs) const {
        const int planned = accuracy_.samples ? accuracy_.samples->replicates : std::max(fewest_, runs + 1);
        return static_cast<double>(runs) / planned;
    }
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
    }

  private:
    const Accuracy& accuracy_;
    int fewest_, most_;
    double time_share_;
    std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
};

}  // namespace gonio
