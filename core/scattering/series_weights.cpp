#include "scattering/series_weights.h"

#include <algorithm>
#include <cmath>

namespace gonio {
namespace {

double chebyshev_beyond_one(int degree, double x) {
    return std::cosh(degree * std::acosh(x));
}

}  // namespace

// A polynomial q of degree n stands for 1 / (1 - x) with the residual R = 1 - (1 - x) q, any polynomial of
// degree n + 1 with R(1) = 1. T_m(x / bound) / T_m(1 / bound) is the smallest on [-bound, bound] (Golub &
// Varga 1961); factors x^z before it leave the direct term alone and favour small x, where most of the light
// is.
SeriesWeights series_weights(int n_orders, double bound) {
    SeriesWeights weights;
    weights.of_order.assign(n_orders, 1.0);
    if (n_orders == 0 || !(bound > 0)) return weights;
    // In powers of x, T_m has coefficients up to (1 + sqrt 2)^m: rounding is magnified by no more than this.
    constexpr double most_magnified = 100;
    int m = n_orders - 1;
    while (m > 0 && std::pow(1 + std::sqrt(2.0), m) > most_magnified * chebyshev_beyond_one(m, 1 / bound))
        --m;
    weights.zeros = n_orders + 1 - m;
    weights.largest = 1 / chebyshev_beyond_one(m, 1 / bound);

    std::vector<double> before{1}, t{0, 1 / bound};  // T_0 and T_1 of x / bound, by powers of x
    for (int k = 2; k <= m; ++k) {
        std::vector<double> next(k + 1, 0.0);
        for (size_t i = 0; i < t.size(); ++i) next[i + 1] += 2 / bound * t[i];
        for (size_t i = 0; i < before.size(); ++i) next[i] -= before[i];
        before = std::move(t);
        t = std::move(next);
    }
    if (m == 0) t = before;
    // q = (1 - R) / (1 - x): its coefficients are the running sums of those of 1 - R, and that of x^0 is 1.
    double sum = 1;
    for (int k = 1; k <= n_orders; ++k) {
        if (k >= weights.zeros) sum -= t[k - weights.zeros] * weights.largest;
        weights.of_order[k - 1] = sum;
    }
    return weights;
}

}  // namespace gonio
