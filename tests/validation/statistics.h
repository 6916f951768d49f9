// How far noisy values may lie from the truth: a bound that a right program exceeds with a stated probability
// over a whole test.
#pragma once
#include <cmath>
#include <vector>

namespace gonio::reference {

// Sigmas that the largest of n independent normal deviates exceeds with probability alpha (Sidak 1967).
inline double sidak_sigmas(size_t n, double alpha = 0.01) {
    const double tail = -std::expm1(std::log1p(-alpha) / static_cast<double>(n));  // two-sided, of one value
    double low = 0, high = 40;
    for (int k = 0; k < 100; ++k) {
        const double middle = (low + high) / 2;
        (std::erfc(middle / std::sqrt(2.0)) > tail ? low : high) = middle;
    }
    return low;
}

inline double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace gonio::reference
