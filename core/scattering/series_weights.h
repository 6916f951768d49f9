// How to weigh the first orders of scattering so that they stand for all of them.
#pragma once
#include <vector>

namespace gonio {

// sum_{k=1..n} of_order[k - 1] x^k stands for sum_{k>=1} x^k = x / (1 - x): off by at most
// |x|^zeros / (1 - x) * largest for |x| <= bound.
struct SeriesWeights {
    std::vector<double> of_order;
    int zeros = 0;
    double largest = 0;
};

// bound: of the spectrum of albedo * K, [0, 1). Weights of 1 and a geometric continuation of the last order,
// the tempting alternative, know one eigenvalue; between two walls K has +x and -x.
SeriesWeights series_weights(int n_orders, double bound);

}  // namespace gonio
