// The weights against the sum they stand for, eigenvalue by eigenvalue.
#include "scattering/series_weights.h"

#include <gtest/gtest.h>

#include <cmath>

namespace gonio {
namespace {

TEST(SeriesWeights, ErrorIsWithinItsBoundAndReachesIt) {
    for (const double bound : {0.05, 0.3, 0.6, 0.9, 0.99})
        for (const int n : {1, 2, 5, 12, 30}) {
            const SeriesWeights weights = series_weights(n, bound);
            ASSERT_EQ(weights.of_order.size(), static_cast<size_t>(n));
            double worst = 0;
            for (int i = -200; i <= 200; ++i) {
                const double x = bound * i / 200, left = std::abs(std::pow(x, weights.zeros)) / (1 - x);
                double sum = 0;
                for (int k = 1; k <= n; ++k) sum += weights.of_order[k - 1] * std::pow(x, k);
                const double error = std::abs(sum - x / (1 - x));
                EXPECT_LE(error, left * weights.largest + 1e-12) << x << " of " << bound << ", " << n;
                if (left > 0) worst = std::max(worst, error / left);
            }
            EXPECT_GT(worst, 0.9 * weights.largest) << bound << ", " << n;
        }
}

TEST(SeriesWeights, AreBetterThanAPlainSum) {
    const SeriesWeights weights = series_weights(6, 0.5);
    double weighed = 0, plain = 0;  // largest errors on the interval
    for (int i = -200; i <= 200; ++i) {
        const double x = 0.5 * i / 200;
        double with = -x / (1 - x), without = with;
        for (int k = 1; k <= 6; ++k) {
            with += weights.of_order[k - 1] * std::pow(x, k);
            without += std::pow(x, k);
        }
        weighed = std::max(weighed, std::abs(with));
        plain = std::max(plain, std::abs(without));
    }
    EXPECT_LT(5 * weighed, plain);
}

TEST(SeriesWeights, NothingToContinue) {
    EXPECT_TRUE(series_weights(0, 0.5).of_order.empty());
    EXPECT_EQ(series_weights(3, 0).of_order, std::vector<double>(3, 1.0));
}

// Rounding of the orders must not be blown up: what counts is weight times x^k.
TEST(SeriesWeights, KeepRoundingSmall) {
    for (const double bound : {0.3, 0.6, 0.8, 0.9, 0.95, 0.995})
        for (const int n : {4, 16, 64}) {
            const SeriesWeights weights = series_weights(n, bound);
            double most = 0;
            for (int k = 1; k <= n; ++k)
                most = std::max(most, std::abs(weights.of_order[k - 1]) * std::pow(bound, k));
            EXPECT_LT(most, 200) << bound << ", " << n;
        }
}

}  // namespace
}  // namespace gonio
