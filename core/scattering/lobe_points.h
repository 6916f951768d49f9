// Random numbers for the lobes that neighbouring rays leave along: R3 (Roberts 2018), randomly shifted, so
// that neighbouring facets sample their lobes differently.
#pragma once
#include <array>
#include <cstdint>

#include "base/numeric.h"
#include "base/random.h"

namespace gonio {

class LobePoints {
  public:
    explicit LobePoints(const std::array<uint32_t, 4>& words) {
        for (int k = 0; k < 3; ++k) shift_[k] = uniform_double(words[k]);
    }
    // In [0, 1): for the choice of the lobe and for the direction in it.
    std::array<double, 3> next() {
        constexpr double alpha[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
        const double k = static_cast<double>(++count_);
        std::array<double, 3> point;
        for (int n = 0; n < 3; ++n) point[n] = fractional_part(shift_[n] + k * alpha[n]);
        return point;
    }

  private:
    double shift_[3];
    uint64_t count_ = 0;
};

}  // namespace gonio
