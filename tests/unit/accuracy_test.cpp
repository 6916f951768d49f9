// Errors must be honest where the truth is known: synthetic runs with Gaussian noise.
#include "measure/accuracy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/numeric.h"
#include "measure/run_limit.h"
#include "measure/stage_average.h"
#include "surface/generate.h"

namespace gonio {
namespace {

// Student's distribution function by Simpson's rule on its density.
double student_cdf(double t, double freedom) {
    const double scale =
        std::exp(std::lgamma((freedom + 1) / 2) - std::lgamma(freedom / 2)) / std::sqrt(freedom * pi);
    constexpr int n = 2000;
    double sum = 0;
    for (int k = 0; k <= n; ++k) {
        const double x = t * k / n, density = std::pow(1 + x * x / freedom, -(freedom + 1) / 2);
        sum += density * (k == 0 || k == n ? 1 : k % 2 ? 4 : 2);
    }
    return 0.5 + scale * sum * t / n / 3;
}

TEST(Accuracy, StudentOneSigmaIsTheQuantile) {
    const double one_sigma = 0.5 * std::erfc(-1 / std::sqrt(2.0));
    for (const double freedom : {1.0, 1.5, 2.0, 3.0, 4.0, 5.5, 7.0, 8.0, 12.0, 20.0, 100.0, 1000.0}) {
        double low = 0.5, high = 3;
        for (int k = 0; k < 60; ++k) {
            const double middle = (low + high) / 2;
            (student_cdf(middle, freedom) < one_sigma ? low : high) = middle;
        }
        EXPECT_NEAR(student_one_sigma(freedom), low, (freedom < 3 ? 0.01 : 0.005) * low) << freedom;
    }
    EXPECT_GE(student_one_sigma(0), student_one_sigma(1));
}

TEST(Accuracy, MomentsAreMeanAndVariance) {
    std::mt19937 random(1);
    std::normal_distribution<float> normal;
    constexpr size_t n = 50;
    constexpr int runs = 7;
    Moments moments;
    std::vector<std::vector<float>> values(runs, std::vector<float>(n));
    for (int r = 0; r < runs; ++r) {
        for (size_t i = 0; i < n; ++i) values[r][i] = 1e4f + normal(random);  // a mean that cancels
        moments.add(values[r]);
    }
    EXPECT_EQ(moments.count(), runs);
    for (size_t i = 0; i < n; ++i) {
        double mean = 0, squares = 0;
        for (const auto& v : values) mean += v[i] / static_cast<double>(runs);
        for (const auto& v : values) squares += (v[i] - mean) * (v[i] - mean);
        EXPECT_NEAR(moments.mean()[i], mean, 1e-9);
        EXPECT_NEAR(moments.variance(i), squares / (runs - 1), 1e-7);
    }
}

TEST(Accuracy, ErrorScaleFloorsAtOnePercentOfTheMean) {
    const std::vector<double> scale = error_scale({1, 3, 0, -2});
    EXPECT_EQ(scale, (std::vector<double>{1, 3, 0.015, 2}));
    EXPECT_EQ(error_scale({0, 0}), (std::vector<double>{0, 0}));
}

struct Coverage {
    double within[3] = {};  // 1, 2, 3 sigma
    // Too few covered is worse than too many: the first is false, the second only timid.
    void expect_near_normal(double too_few, double too_many) const {
        const double normal[3] = {0.6827, 0.9545, 0.9973};
        for (int k = 0; k < 3; ++k) {
            EXPECT_GT(within[k], normal[k] - too_few) << k + 1 << " sigma";
            EXPECT_LT(within[k], normal[k] + too_many) << k + 1 << " sigma";
        }
    }
};

// Noise of tables of n_lights x n_views rows: row factor x column factor, spread log-normally by `spread`;
// `residual` spreads single rows around that. The rows of a run share so many random numbers, as rows that
// share the shifts of a run do; 0: none.
struct Noise {
    int n_lights = 1, n_views = 1, runs = 4;
    double spread = 0, residual = 0;
    int shared = 0;
};

Coverage coverage(const Noise& noise, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Coverage result;
    const int rows = noise.n_lights * noise.n_views, tables = std::max(1000, 60000 / rows);
    for (int table = 0; table < tables; ++table) {
        RowGroups groups;
        groups.n_lights = noise.n_lights, groups.n_views = noise.n_views;
        std::vector<double> of_light(noise.n_lights), of_view(noise.n_views), truth(rows), sigma(rows),
            loading(static_cast<size_t>(rows) * noise.shared), common(noise.shared);
        for (double& v : of_light) v = std::exp(noise.spread * normal(random));
        for (double& v : of_view) v = std::exp(noise.spread * normal(random));
        for (int r = 0; r < rows; ++r) {
            const int l = r / noise.n_views, v = r % noise.n_views;
            groups.light.push_back(l);
            groups.view.push_back(v);
            truth[r] = 0.2 * std::exp(0.3 * normal(random));
            sigma[r] =
                0.003 * truth[r] * of_light[l] * of_view[v] * std::exp(noise.residual * normal(random));
            double norm = 0;
            for (int k = 0; k < noise.shared; ++k) {
                double& x = loading[static_cast<size_t>(r) * noise.shared + k] = normal(random);
                norm += x * x;
            }
            for (int k = 0; k < noise.shared; ++k)
                loading[static_cast<size_t>(r) * noise.shared + k] /= std::sqrt(norm);
        }
        // A second slice in front, to see that `first` is respected.
        Moments moments;
        std::vector<float> values(2 * rows, 1.0f);
        for (int k = 0; k < noise.runs; ++k) {
            for (double& z : common) z = normal(random);
            for (int r = 0; r < rows; ++r) {
                double z = noise.shared ? 0 : normal(random);
                for (int c = 0; c < noise.shared; ++c)
                    z += loading[static_cast<size_t>(r) * noise.shared + c] * common[c];
                values[rows + r] = static_cast<float>(truth[r] + sigma[r] * z);
            }
            moments.add(values);
        }
        const std::vector<double> se = standard_errors(moments, rows, groups);
        for (int r = 0; r < rows; ++r)
            for (int k = 0; k < 3; ++k)
                result.within[k] += std::abs(moments.mean()[rows + r] - truth[r]) < (k + 1) * se[r];
    }
    for (double& share : result.within) share /= static_cast<double>(tables) * rows;
    return result;
}

// Independent rows, which more pooling would serve better than rows that share their shifts.
TEST(Accuracy, StandardErrorsCoverIndependentRows) {
    for (const int runs : {4, 8, 16})
        for (const double spread : {0.0, 0.4})
            for (const auto& [lights, views] :
                 {std::pair{12, 12}, {30, 5}, {3, 40}, {1, 64}, {64, 1}, {1, 8}}) {
                SCOPED_TRACE(testing::Message()
                             << lights << " x " << views << ", " << runs << " runs, spread " << spread);
                coverage({lights, views, runs, spread, 0, 0}, 1).expect_near_normal(0.05, 0.05);
            }
}

TEST(Accuracy, StandardErrorsCoverRowsThatShareTheirShifts) {
    for (const int runs : {4, 8})
        for (const int shared : {2, 6})
            for (const auto& [lights, views] : {std::pair{12, 12}, {1, 64}}) {
                SCOPED_TRACE(testing::Message() << lights << " x " << views << ", " << runs << " runs, "
                                                << shared << " shared numbers");
                coverage({lights, views, runs, 0.4, 0, shared}, 1).expect_near_normal(0.05, 0.05);
            }
}

// Rows that the model of factors does not fit to the last: the tails suffer first, for one prior serves all.
TEST(Accuracy, StandardErrorsCoverUnevenTables) {
    for (const int runs : {4, 8, 16}) {
        SCOPED_TRACE(testing::Message() << runs << " runs");
        coverage({12, 12, runs, 0.4, 0.25, 0}, 4).expect_near_normal(0.05, 0.05);
    }
}

// A lone value has nothing to pool with: one sigma is Student's, wider ones are his longer tails.
TEST(Accuracy, LoneValuesCoverOneSigma) {
    for (const int runs : {4, 8})
        EXPECT_NEAR(coverage({1, 1, runs, 0, 0, 0}, 5).within[0], 0.6827, 0.01) << runs << " runs";
}

TEST(Accuracy, RowsWithoutLightOrNoiseHaveNoError) {
    RowGroups groups;
    groups.light = {0, 0, 1, 1}, groups.view = {0, 1, 0, 1};
    groups.n_lights = groups.n_views = 2;
    Moments constant, black;
    for (int k = 0; k < 4; ++k) {
        constant.add({1, 2, 3, 4});
        black.add({0, 0, 0, 0});
    }
    for (const Moments* moments : {&constant, &black})
        for (const double se : standard_errors(*moments, 0, groups)) EXPECT_EQ(se, 0);
}

// Two stages that scatter alike. What the first saw of the second view is none of its light, and hides it
// all.
TEST(Stages, OneThatMissedSliversWeighsLittle) {
    const HeightField plane = generate_plane(2, 1);
    const Material material{{"y"}, Lambertian{{1}}};
    MeasuredScene scene;
    scene.surface = &plane;
    scene.material = &material;
    scene.lights = {{0, 0, 1}};
    scene.views = {{0, 0, 1}, {0.8, 0, 0.6}};
    scene.groups.light = {0, 0}, scene.groups.view = {0, 1};
    scene.groups.n_lights = 1, scene.groups.n_views = 2;
    std::vector<Stage> stages(2);
    for (int k = 0; k < 2; ++k)
        for (const float noise : {-0.01f, 0.01f}) {
            const float seen = k == 0 ? 0.5f : 1.0f;
            stages[k].f.add({1 + noise, seen + noise});
            stages[k].projected_lights.add({1});
            stages[k].projected_views.add({1, seen});
        }
    const Estimate e = average_stages(scene, stages);
    EXPECT_NEAR(e.f[1], 1, 0.01);
    EXPECT_LT(e.hidden[1], 0.01);
    EXPECT_GT(e.hidden[1], 0);
    EXPECT_EQ(e.hidden[0], 0);
    EXPECT_EQ(hidden_light(scene, stages[1], 0), (std::vector<double>{0, 0}));
    Stage blind;
    blind.f.add({1, 0});
    blind.projected_lights.add({1});
    blind.projected_views.add({1, 0});
    EXPECT_DOUBLE_EQ(hidden_light(scene, blind, 0)[1], 1 / pi);  // at most 1 / (pi cos)
}

TEST(RunLimit, RunsAreThoseAskedForOrThoseThatATargetTakes) {
    Accuracy asked;
    asked.samples = Accuracy::Samples{1, 64, 1, 3};
    const RunLimit three(asked, 4, 64);  // more than the fewest are not insisted on
    EXPECT_TRUE(three.wants_more(2, 0));
    EXPECT_FALSE(three.wants_more(3, 1));
    EXPECT_DOUBLE_EQ(three.fraction(1), 1.0 / 3);

    Accuracy target;
    target.target_relative_error = 0.01;
    const RunLimit open(target, 2, 8);
    EXPECT_TRUE(open.wants_more(1, 0));
    EXPECT_FALSE(open.wants_more(2, 0.01));
    EXPECT_TRUE(open.wants_more(7, 0.02));
    EXPECT_FALSE(open.wants_more(8, 0.02));
    EXPECT_DOUBLE_EQ(open.fraction(3), 0.75);
}

TEST(RunLimit, ARunThatWouldEndTooLateIsNotBegun) {
    Accuracy brief;
    brief.target_relative_error = 0.01;
    brief.max_seconds = 1e-12;
    EXPECT_TRUE(RunLimit(brief, 2, 8).wants_more(1, 1));  // without two there is no error
    EXPECT_FALSE(RunLimit(brief, 2, 8).wants_more(2, 1));
    brief.max_seconds = 1e6;
    EXPECT_TRUE(RunLimit(brief, 2, 8).wants_more(2, 1));
    EXPECT_FALSE(RunLimit(brief, 2, 8, 1e-18).wants_more(2, 1));
}

}  // namespace
}  // namespace gonio
