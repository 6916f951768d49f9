// Every skip is named in the report and changes nothing: the same job with the skips forced off.
#include <gtest/gtest.h>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "surface/generate.h"

namespace gonio {
namespace {

const std::vector<AnglesDeg> lights = {{0, 0}, {30, 20}, {60, 130}, {75, 250}};
const std::vector<AnglesDeg> views = {{10, 200}, {45, 75}, {70, 310}};
const Accuracy::Samples few{2, 64, 1, 4};

HeightField rough() {
    return generate_gaussian(48, 48, 1e-4, 6e-4, 0.7, 5);
}

struct Both {
    BrdfResult skipping, all;
};
Both both(const HeightField& surface, const Material& material, const BrdfPlan& plan) {
    return {measure(surface, material, plan, true), measure(surface, material, plan, false)};
}

TEST(Skip, PlaneIsExact) {
    for (const bool separate : {false, true}) {
        BrdfPlan plan = plan_of(lights, views, few);
        plan.separate_orders = separate;
        plan.max_order = separate ? 3 : 0;
        const Both result = both(generate_plane(8, 1e-3), gray({0.7, 0.2}), plan);
        EXPECT_TRUE(was_skipped(result.skipping.report, "all tracing"));
        EXPECT_FALSE(was_skipped(result.all.report, "all tracing"));
        EXPECT_EQ(result.skipping.table.orders, plan.max_order);
        expect_tables_near(result.skipping.table, result.all.table, 1e-5);
        for (size_t row = 0; row < result.all.table.rows(); ++row)
            EXPECT_NEAR(result.skipping.table.f[row], 0.7 / pi, 1e-7);
    }
}

TEST(Skip, BlackIsExact) {
    const Both result = both(rough(), gray({0.0}), plan_of(lights, views, few));
    EXPECT_TRUE(was_skipped(result.skipping.report, "all tracing"));
    for (const Table* table : {&result.skipping.table, &result.all.table})
        for (const float f : table->f) EXPECT_EQ(f, 0);
}

TEST(Skip, GentleSurfaceHasNoIndirectLight) {
    const HeightField gentle = generate_gaussian(48, 48, 1e-4, 6e-4, 1e-3, 5);
    const Both result = both(gentle, gray({0.9}), plan_for_target(lights, views, 0.01));
    EXPECT_TRUE(was_skipped(result.skipping.report, "indirect light"));
    EXPECT_FALSE(was_skipped(result.all.report, "indirect light"));
    const Table &a = result.skipping.table, &b = result.all.table;
    for (size_t k = 0; k < a.f.size(); ++k) {
        EXPECT_GT(a.bias[k], 0);
        EXPECT_LE(std::abs(a.f[k] - b.f[k]), a.bias[k] + 3 * std::hypot(a.se[k], b.se[k]) + 1e-6);
    }
}

// The same random numbers reach every row of the long surface: nothing but rounding may differ.
TEST(Skip, SurfaceInvariantAlongYIsOneRow) {
    HeightField one = generate_gaussian(64, 1, 1e-4, 6e-4, 0.7, 2), many = one;
    many.ny = 12;
    many.heights.clear();
    for (int j = 0; j < many.ny; ++j)
        many.heights.insert(many.heights.end(), one.heights.begin(), one.heights.end());
    const Both result = both(many, gray({0.8}), plan_of(lights, views, few));
    EXPECT_TRUE(was_skipped(result.skipping.report, "all rows but one"));
    EXPECT_FALSE(was_skipped(result.all.report, "all rows but one"));
    // The guess of the mesh bias differs, the values do not.
    expect_tables_agree(result.skipping.table, result.all.table, 1);
    expect_tables_near(measure(one, gray({0.8}), plan_of(lights, views, few)).table, result.skipping.table,
                       1e-6);
}

TEST(Skip, SurfaceInvariantAlongXIsOneColumn) {
    const HeightField groove = generate_gaussian(64, 1, 1e-4, 6e-4, 0.7, 2);
    HeightField turned = groove;
    turned.nx = 9, turned.ny = 64;
    turned.heights.clear();
    for (int j = 0; j < 64; ++j)
        for (int i = 0; i < 9; ++i) turned.heights.push_back(groove.heights[j]);
    const BrdfPlan plan = plan_of(lights, views, Accuracy::Samples{16, 256, 1, 8});
    const Both result = both(turned, gray({0.8}), plan);
    EXPECT_TRUE(was_skipped(result.skipping.report, "all columns but one"));
    EXPECT_FALSE(was_skipped(result.all.report, "all columns but one"));
    expect_tables_agree(result.skipping.table, result.all.table, 4);
    // phi -> 90 deg - phi exchanges the axes.
    BrdfPlan exchanged = plan;
    for (auto* list : {&exchanged.incident, &exchanged.outgoing})
        for (AnglesDeg& a : *list) a.phi_deg = 90 - a.phi_deg;
    expect_tables_near(measure(groove, gray({0.8}), exchanged).table, result.skipping.table, 1e-5);
}

TEST(Skip, SameLightsAndViewsAreHalfTheWork) {
    std::vector<AnglesDeg> shuffled = lights;
    std::swap(shuffled[0], shuffled[2]);
    for (const auto& same : {lights, shuffled}) {
        const Both result = both(rough(), gray({0.8}), plan_of(lights, same, few));
        EXPECT_TRUE(was_skipped(result.skipping.report, "half of the directions"));
        EXPECT_FALSE(was_skipped(result.all.report, "half of the directions"));
        expect_tables_agree(result.skipping.table, result.all.table, 1);
    }
    EXPECT_FALSE(was_skipped(measure(rough(), gray({0.8}), plan_of(lights, views, few)).report,
                             "half of the directions"));
}

TEST(Skip, SteepDirectionsNeedNoShadowTest) {
    const HeightField surface = generate_gaussian(48, 48, 1e-4, 6e-4, 0.3, 5);
    BrdfPlan plan = plan_of({{0, 0}, {15, 200}, {62, 10}}, {{8, 0}, {55, 300}, {65, 120}}, few);
    plan.max_order = 1;
    const Both result = both(surface, gray({0.8}), plan);
    EXPECT_TRUE(was_skipped(result.skipping.report, "shadow tests of steep directions"));
    EXPECT_FALSE(was_skipped(result.all.report, "shadow tests of steep directions"));
    expect_tables_near(result.skipping.table, result.all.table, 1e-5);
}

// The orders of one run, weighed for each albedo, against runs for each albedo alone. These skip nothing, so
// that all measure the mesh bias on two grids: a dark surface alone would only guess it.
TEST(Skip, OneRunServesAllChannels) {
    const std::vector<double> albedos = {0.2, 0.5, 0.9};
    const HeightField fine = generate_gaussian(48, 48, 1e-4, 2e-4, 0.7, 5);
    const BrdfResult three = measure(fine, gray(albedos), plan_of(lights, views, few));
    EXPECT_TRUE(was_skipped(three.report, "all channels but one"));
    ASSERT_FALSE(was_skipped(three.report, "two-grid run"));
    for (size_t c = 0; c < 3; ++c) {
        const Table one = measure(fine, gray({albedos[c]}), plan_of(lights, views, few), false).table;
        for (size_t row = 0; row < one.rows(); ++row) {
            const size_t k = three.table.index(c, 0, row);
            EXPECT_NEAR(three.table.f[k], one.f[row], 1e-4 * one.f[row]) << "albedo " << albedos[c];
        }
    }
}

TEST(Skip, CombinedOrdersAreTheSumOfSingleOnes) {
    BrdfPlan apart = plan_of(lights, views, few);
    apart.separate_orders = true;
    apart.max_order = 40;
    const BrdfResult together = measure(rough(), gray({0.8}), plan_of(lights, views, few));
    EXPECT_TRUE(was_skipped(together.report, "a product per order"));
    const BrdfResult orders = measure(rough(), gray({0.8}), apart);
    EXPECT_FALSE(was_skipped(orders.report, "a product per order"));
    ASSERT_EQ(orders.table.orders, 40);
    for (size_t row = 0; row < together.table.rows(); ++row)
        EXPECT_NEAR(together.table.f[row], orders.table.f[row],
                    2e-5 * together.table.f[row] + together.table.bias[row]);
}

TEST(Skip, TwoGridRun) {
    // Facets that resolve the relief well: the guess of the mesh bias is far below the target.
    const HeightField smooth = generate_gaussian(64, 64, 1e-4, 12e-4, 0.5, 5);
    const Both result = both(smooth, gray({0.5}), plan_for_target(lights, views, 0.03));
    EXPECT_TRUE(was_skipped(result.skipping.report, "two-grid run"));
    EXPECT_FALSE(was_skipped(result.all.report, "two-grid run"));
    expect_tables_agree(result.skipping.table, result.all.table, 4);
}

}  // namespace
}  // namespace gonio
