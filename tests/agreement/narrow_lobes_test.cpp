// Lobes narrower than the shared directions are dense, into point directions: right, and honest about what is
// missed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "measure/reference.h"
#include "surface/generate.h"

namespace gonio {
namespace {

Material ggx(double alpha) {
    Microfacet lobe;
    lobe.alpha_x = lobe.alpha_y = alpha;
    lobe.reflectance.reflectance = 1.0;
    return {{"y"}, lobe};
}

HeightField relief() {
    return generate_gaussian(64, 64, 1, 8, 0.7, 12);
}

// How far one order of tables is from the truth, in what they state and the truth's own noise.
struct Coverage {
    std::array<int, 3> within{};
    int entries = 0;
    double difference = 0, variance = 0;  // of the sums over the entries
    double squares = 0, stated = 0;

    void add(const Table& table, const Table& truth, int order) {
        for (size_t row = 0; row < table.rows(); ++row) {
            const size_t k = table.index(0, order, row);
            const double off = table.f[k] - truth.f[k],
                         sigma = std::hypot(table.se[k], table.bias[k], truth.se[k]);
            ++entries;
            for (int n = 0; n < 3; ++n) within[n] += std::abs(off) <= (n + 1) * sigma;
            difference += off;
            variance += sigma * sigma;
            squares += off * off;
            stated += sigma * sigma;
        }
    }
    double percent(int n) const { return 100.0 * within[n] / entries; }
    std::string text() const {
        char line[120];
        std::snprintf(line, sizeof line,
                      "%.1f %.1f %.1f %% within 1, 2, 3 sigma; rms error %.2e, stated %.2e", percent(0),
                      percent(1), percent(2), std::sqrt(squares / entries), std::sqrt(stated / entries));
        return line;
    }
};

// Order 2 by pairs or by rays, those beyond by rays. Errors are cautious where views are darker than the
// mean, for the least error is the same for all of them.
TEST(NarrowLobes, ErrorsCoverThePathTracer) {
    for (const double alpha : {0.12, 0.08, 0.04}) {
        BrdfPlan plan = plan_of(equal_projected_hemisphere(16), product_grid({20, 50, 70}, {30, 150, 270}),
                                Accuracy::Samples{2, 64, 1, 6});
        plan.separate_orders = true;
        plan.max_order = 4;
        const Table truth = measure_reference(relief(), ggx(alpha), plan, {1 << 16}, {}).table;
        std::array<Coverage, 5> orders;
        for (int seed = 1; seed <= 3; ++seed) {
            plan.accuracy.seed = seed;
            const Table table = measure(relief(), ggx(alpha), plan).table;
            for (int order : {0, 2, 3, 4}) orders[order].add(table, truth, order);
        }
        for (int order : {0, 2, 3, 4}) {
            SCOPED_TRACE("alpha " + std::to_string(alpha) + ", order " + std::to_string(order) + ": " +
                         orders[order].text());
            EXPECT_GT(orders[order].percent(0), 63);
            EXPECT_GT(orders[order].percent(1), 92);
            EXPECT_GT(orders[order].percent(2), 97.5);
            EXPECT_LT(orders[order].stated, 4 * orders[order].squares);
            // Three tables share their truth: 4 sigma of a sum that is not as independent as its entries.
            EXPECT_LT(std::abs(orders[order].difference), 4 * std::sqrt(3 * orders[order].variance));
        }
    }
}

// Mean f over the hemisphere, weighted by the cosine, from where light ends that is traced forward.
Table hemispherical(const Material& material, const std::vector<AnglesDeg>& lights, int max_order) {
    BrdfPlan plan = plan_of(lights, {}, Accuracy::Samples{4, 64, 1, 4});
    plan.outgoing_cells = equal_cells(1);
    plan.outgoing = centres(plan.outgoing_cells);
    plan.separate_orders = true;
    plan.max_order = max_order;
    plan.transport = TransportKind::forward;
    return measure(relief(), material, plan).table;
}

// Towards 400 views, even in projected solid angle, goes as much of every order as leaves the relief: within
// the noise of so many rays that hit, for views share them.
TEST(NarrowLobes, NoOrderLosesLight) {
    const std::vector<AnglesDeg> lights = {{10, 40}, {45, 200}, {65, 95}};
    constexpr double rays = 8 * 2 * 64 * 64;  // of a light: 8 runs, one a facet
    BrdfPlan plan = plan_of(lights, equal_projected_hemisphere(400), Accuracy::Samples{2, 256, 1, 8});
    plan.separate_orders = true;
    plan.max_order = 3;
    for (const double alpha : {0.12, 0.06}) {
        const Table table = measure(relief(), ggx(alpha), plan).table,
                    all = hemispherical(ggx(alpha), lights, 3);
        for (size_t light = 0; light < lights.size(); ++light)
            for (int order : {2, 3}) {
                double mean = 0;
                for (size_t view = 0; view < 400; ++view)
                    mean += table.f[table.index(0, order, light * 400 + view)] / 400;
                const size_t k = all.index(0, order, light);
                const double noise = all.f[k] / std::sqrt(rays * pi * all.f[k]);
                EXPECT_NEAR(mean, all.f[k], 4 * std::hypot(noise, doubt(all, k)))
                    << "alpha " << alpha << ", light " << light << ", order " << order;
            }
    }
}

// No sample meets a lobe of alpha 1e-4. What its orders 2 and up carry in all is known, and stated.
TEST(NarrowLobes, WhatNoSampleMeetsIsInTheBias) {
    const std::vector<AnglesDeg> lights = {{20, 40}, {60, 200}};
    BrdfPlan plan = plan_of(lights, {{10, 100}, {40, 300}, {65, 20}});
    plan.separate_orders = true;
    plan.max_order = 3;
    const BrdfResult found = measure(relief(), ggx(1e-4), plan);
    const Table energy = hemispherical(ggx(1e-4), lights, 3);
    for (size_t row = 0; row < found.table.rows(); ++row)
        for (int order : {2, 3}) {
            const double mean = energy.f[energy.index(0, order, row / 3)];
            EXPECT_NEAR(doubt(found.table, found.table.index(0, order, row)), mean, 0.15 * mean);
        }
    EXPECT_FALSE(found.report.target_met);
    EXPECT_TRUE(std::any_of(found.report.warnings.begin(), found.report.warnings.end(), [](const auto& text) {
        return text.find("chains of samples meet a view") != std::string::npos;
    }));
}

}  // namespace
}  // namespace gonio
