// Every transport on every relief with every material against the path tracer, order by order; and where a
// transport cannot answer, it says so and names what to change.
//
// Declared error: each value of each table lies within bound() combined standard errors of the path tracer's,
// sigma^2 = se^2 + bias^2 of the engine + se^2 of the judge. bound() is what a right engine exceeds anywhere
// in the whole matrix with a probability of 1 % (Sidak's correction for all values compared; the errors of a
// few runs follow Student's t and are turned into normal deviates). The rms of the combined errors of a table
// is itself at most largest_rms_error of the rms of its values, so agreement says something. Seeds are fixed.
#include <gtest/gtest.h>

#include <cmath>

#include "agreement/measured.h"
#include "agreement/standard_cases.h"
#include "base/error.h"
#include "measure/reference.h"
#include "measure/simplify.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

constexpr int runs = 10, orders = 3, n_cells = 12;
constexpr double largest_rms_error = 0.03;

struct Pair {
    const standard::Relief* relief;
    const standard::Facets* facets;
};

void PrintTo(const Pair& pair, std::ostream* out) {
    *out << pair.facets->name << " on " << pair.relief->name;
}

std::vector<Pair> pairs() {
    std::vector<Pair> all;
    for (const standard::Relief& relief : standard::reliefs)
        for (const standard::Facets& facets : standard::materials) all.push_back({&relief, &facets});
    return all;
}

bool has_mirror(const Material& material) {
    return std::any_of(material.lobes.begin(), material.lobes.end(),
                       [](const WeightedLobe& part) { return std::holds_alternative<Mirror>(part.lobe); });
}

std::vector<TransportKind> transports_of(const Material& material) {
    using enum TransportKind;
    if (has_mirror(material)) return {forward};
    if (pure_lambertian(material)) return {diffuse, pair_graph, forward};
    return {pair_graph, forward};
}

BrdfPlan in_orders(BrdfPlan plan) {
    plan.separate_orders = true;
    plan.max_order = orders;
    return plan;
}

BrdfPlan direction_plan() {
    return in_orders(
        plan_of({{15, 40}, {50, 200}, {70, 95}}, {{30, 10}, {60, 140}}, Accuracy::Samples{4, 128, 2, runs}));
}

int measured_cells(const HeightField& s) {
    return (s.nx - 2 * s.border_x) * (s.ny - 2 * s.border_y);
}

// As many rays from a small relief as from a large one.
BrdfPlan cell_plan(const HeightField& surface) {
    const int sub_samples = std::clamp(4096 / measured_cells(surface), 1, 2048);
    BrdfPlan plan =
        in_orders(plan_of({{20, 30}, {62, 205}}, {}, Accuracy::Samples{sub_samples, 64, 1, runs}));
    plan.outgoing_cells = equal_cells(n_cells);
    plan.outgoing = centres(plan.outgoing_cells);
    return plan;
}

BrdfPlan plan_for(TransportKind transport, const HeightField& surface) {
    BrdfPlan plan = transport == TransportKind::forward ? cell_plan(surface) : direction_plan();
    plan.transport = transport;
    return plan;
}

// Values compared in the whole matrix.
size_t comparisons() {
    size_t n = 0;
    for (const Pair& pair : pairs()) {
        const Material material = pair.facets->make(1, 1);
        for (const TransportKind transport : transports_of(material)) {
            const BrdfPlan plan = plan_for(transport, generate_plane(1, 1));
            n += material.channels.size() * (orders + 1) * plan.incident.size() * plan.outgoing.size();
        }
    }
    return n;
}

double bound() {
    static const double sigmas = reference::sidak_sigmas(comparisons());
    return sigmas;
}

// The normal deviate as far out as t is in Student's distribution of so many degrees of freedom (Wallace
// 1959, "Bounds on normal approximations to Student's and the chi-square distributions").
double normal_deviate(double t, double freedom) {
    return (8 * freedom + 1) / (8 * freedom + 3) * std::sqrt(freedom * std::log1p(t * t / freedom));
}

void expect_agreement(const Table& engine, const Table& judge, double least_sigma) {
    ASSERT_EQ(engine.f.size(), judge.f.size());
    double variance = 0, brightness = 0;
    for (size_t c = 0; c < engine.channels.size(); ++c)
        for (size_t slice = 0; slice < engine.slices(); ++slice)
            for (size_t row = 0; row < engine.rows(); ++row) {
                const size_t k = engine.index(c, slice, row);
                const double sure = std::hypot(engine.bias[k], judge.se[k], least_sigma),
                             sigma = std::hypot(engine.se[k], sure);
                // Welch and Satterthwaite: only the engine's few runs leave doubt about their own spread.
                const double freedom =
                    (runs - 1) * std::pow(sigma / std::max<double>(engine.se[k], 1e-3 * sigma), 4);
                const double off = engine.f[k] - judge.f[k];
                // Floats.
                if (std::abs(off) > 3e-6 * (1 + judge.f[k])) {
                    EXPECT_LT(normal_deviate(off / sigma, freedom), bound())
                        << "channel " << c << ", order " << slice << ", pair " << row << ": " << engine.f[k]
                        << " +- " << engine.se[k] << " +- " << engine.bias[k] << " and " << judge.f[k]
                        << " +- " << judge.se[k];
                }
                if (slice > 0) continue;
                variance += sigma * sigma;
                brightness += std::pow(judge.f[k], 2);
            }
    EXPECT_LT(variance, std::pow(largest_rms_error, 2) * brightness);
}

class Matrix : public testing::TestWithParam<Pair> {};

TEST_P(Matrix, EveryTransportAgreesWithThePathTracer) {
    const HeightField surface = GetParam().relief->make();
    const Material material = GetParam().facets->make(surface.nx, surface.ny);
    Table viewed, caught;  // the judge's, at directions and in cells
    for (const TransportKind transport : transports_of(material)) {
        SCOPED_TRACE("transport " + std::to_string(static_cast<int>(transport)));
        const BrdfPlan plan = plan_for(transport, surface);
        const bool cells = !plan.outgoing_cells.empty();
        constexpr long long paths = 20000, photons = 40000;
        // Of an open surface's light, what falls outside the border counts for nothing.
        const long long all_photons = photons * surface.nx * surface.ny / measured_cells(surface);
        Table& judge = cells ? caught : viewed;
        if (judge.f.empty())
            judge = measure_reference(surface, material, plan, {cells ? all_photons : paths}, {}).table;
        const Table engine = measure(surface, material, plan).table;
        // What few paths met has a spread that is not known, but not below that of two: photons in a cell, or
        // paths that see the brightest.
        expect_agreement(engine, judge,
                         cells ? 2.0 / photons / (pi / n_cells)
                               : 2.0 / paths * *std::max_element(judge.f.begin(), judge.f.end()));
    }
}

TEST_P(Matrix, WhatATransportCannotAnswerIsRefused) {
    const HeightField surface = GetParam().relief->make();
    const Material material = GetParam().facets->make(surface.nx, surface.ny);
    const auto refused = [&](TransportKind transport, BrdfPlan plan) {
        plan.transport = transport;
        try {
            measure_brdf(surface, material, plan, {});
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::invalid_input);
            EXPECT_FALSE(error.allowed().empty());
            return error.field();
        }
        return std::string("accepted");
    };
    using enum TransportKind;
    // f = albedo / pi, whoever is asked for.
    if (is_plane(surface) && pure_lambertian(material) && !has_maps(material)) {
        EXPECT_EQ(refused(forward, direction_plan()), "accepted");
        return;
    }
    EXPECT_EQ(refused(forward, direction_plan()),
              has_mirror(material) ? "/measure/outgoing" : "/measure/transport");
    if (!pure_lambertian(material)) {
        EXPECT_EQ(refused(diffuse, direction_plan()), "/measure/transport");
        EXPECT_EQ(refused(diffuse, cell_plan(surface)), "/measure/transport");
    }
    if (has_mirror(material)) {
        EXPECT_EQ(refused(automatic, direction_plan()), "/measure/outgoing");
        EXPECT_EQ(refused(pair_graph, direction_plan()), "/measure/outgoing");
        EXPECT_EQ(refused(pair_graph, cell_plan(surface)), "/measure/transport");
    }
}

INSTANTIATE_TEST_SUITE_P(Cases, Matrix, testing::ValuesIn(pairs()), [](const auto& pair) {
    return std::string(pair.param.relief->name) + "__" + pair.param.facets->name;
});

}  // namespace
}  // namespace gonio
