// Short words for measuring in tests, and what every table must be, whatever was asked for.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "measure/brdf.h"

namespace gonio {

inline Material gray(const std::vector<double>& albedo) {
    Lambertian lambertian;
    lambertian.albedo = albedo;
    Material material;
    for (size_t c = 0; c < albedo.size(); ++c) material.channels.push_back("c" + std::to_string(c));
    material.lobes = {{1.0, lambertian}};
    return material;
}

inline BrdfPlan plan_of(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing,
                        std::optional<Accuracy::Samples> samples = {}) {
    BrdfPlan plan;
    plan.incident = std::move(incident);
    plan.outgoing = std::move(outgoing);
    plan.accuracy.samples = samples;
    return plan;
}

inline BrdfPlan plan_for_target(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing,
                                double target) {
    BrdfPlan plan = plan_of(std::move(incident), std::move(outgoing));
    plan.accuracy.target_relative_error = target;
    return plan;
}

// Finite, not negative, and errors stated for every value.
inline void expect_sound(const Table& table) {
    const size_t n = table.channels.size() * table.slices() * table.rows();
    ASSERT_EQ(table.f.size(), n);
    ASSERT_EQ(table.se.size(), n);
    ASSERT_EQ(table.bias.size(), n);
    size_t bad = 0;
    for (size_t k = 0; k < n; ++k)
        for (const float v : {table.f[k], table.se[k], table.bias[k]}) bad += !(std::isfinite(v) && v >= 0);
    EXPECT_EQ(bad, 0u) << "values that are NaN, infinite or negative, of " << 3 * n;
}

inline BrdfResult measure(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                          bool allow_skips = true, int n_threads = 1) {
    RunOptions options;
    options.n_threads = n_threads;
    options.allow_skips = allow_skips;
    BrdfResult result = measure_brdf(surface, material, plan, options);
    expect_sound(result.table);
    return result;
}

inline bool was_skipped(const Report& report, const std::string& what) {
    for (const auto& [key, why] : report.skipped)
        if (key == what) return true;
    return false;
}

inline double doubt(const Table& table, size_t k) {
    return std::hypot(table.se[k], table.bias[k]);
}

// Relative to the larger of the value and 1 % of the largest.
inline void expect_tables_near(const Table& a, const Table& b, double relative) {
    ASSERT_EQ(a.f.size(), b.f.size());
    const float largest = *std::max_element(b.f.begin(), b.f.end());
    for (size_t k = 0; k < a.f.size(); ++k)
        EXPECT_NEAR(a.f[k], b.f[k], relative * std::max(b.f[k], 0.01f * largest)) << "value " << k;
}

// Two measurements that share no random numbers, or each its own approximations.
inline void expect_tables_agree(const Table& a, const Table& b, double sigmas) {
    ASSERT_EQ(a.f.size(), b.f.size());
    for (size_t k = 0; k < a.f.size(); ++k)
        EXPECT_LE(std::abs(a.f[k] - b.f[k]), sigmas * std::hypot(doubt(a, k), doubt(b, k)) + 2e-6 * b.f[k])
            << "value " << k << ": " << a.f[k] << " and " << b.f[k];
}

}  // namespace gonio
