// The glossy engine against the path tracer, which shares with it the relief and the plan alone.
#include <gtest/gtest.h>

#include <algorithm>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "measure/reference.h"
#include "surface/generate.h"

namespace gonio {
namespace {

struct Case {
    const char* name;
    Material material;
};

std::vector<Case> cases() {
    using enum Microfacet::Distribution;
    Microfacet ggx_lobe;
    ggx_lobe.alpha_x = ggx_lobe.alpha_y = 0.3;
    ggx_lobe.reflectance.reflectance = 1.0;
    Microfacet brushed = ggx_lobe;
    brushed.distribution = beckmann;
    brushed.alpha_y = 0.6;
    brushed.rotation_deg = 25.0;
    Microfacet gold = ggx_lobe;
    gold.reflectance.eta = {0.18, 1.4};
    gold.reflectance.k = {3.4, 1.9};
    Material mixture({"y"}, Lambertian{1.0});
    mixture.lobes.front().weight = 0.5;
    mixture.lobes.push_back({0.5, ggx_lobe});
    return {{"ggx", {{"y"}, ggx_lobe}},           {"brushed", {{"y"}, brushed}},
            {"gold", {{"r", "b"}, gold}},         {"mixture", mixture},
            {"phong", {{"y"}, Phong{20.0, 0.9}}}, {"coated", {{"y"}, CoatedDiffuse{1.5, 0.3, 0.8}}}};
}

TEST(GlossyAgreement, TheEngineAndThePathTracerMeasureTheSame) {
    const HeightField surface = generate_gaussian(48, 48, 1e-6, 4e-6, 0.8, 12);
    for (const auto& [name, material] : cases()) {
        SCOPED_TRACE(name);
        BrdfPlan plan =
            plan_of({{15, 40}, {50, 200}, {70, 95}}, {{30, 10}, {60, 140}}, Accuracy::Samples{4, 144, 1, 6});
        plan.separate_orders = true;
        plan.max_order = 3;
        const Table engine = measure(surface, material, plan).table;
        const Table judge = measure_reference(surface, material, plan, {20000}, {}).table;
        double squares = 0;
        for (size_t k = 0; k < engine.f.size(); ++k) {
            const double sigma = std::hypot(doubt(engine, k), doubt(judge, k)) + 1e-6;
            EXPECT_NEAR(engine.f[k], judge.f[k], 4.5 * sigma) << "value " << k;
            squares += std::pow((engine.f[k] - judge.f[k]) / sigma, 2);
        }
        EXPECT_LT(squares / static_cast<double>(engine.f.size()), 2.2);
    }
}

// The series is cut where its tail, continued by the ratio of its last two orders, is known well enough.
TEST(GlossyAgreement, WhatIsCutOffTheSeriesIsContinued) {
    const HeightField surface = generate_gaussian(32, 32, 1e-6, 4e-6, 1.2, 5);
    BrdfPlan plan =
        plan_of({{20, 40}, {50, 200}, {70, 95}}, {{30, 10}, {60, 140}}, Accuracy::Samples{1, 512, 1, 2});
    for (const char* name : {"ggx", "mixture"}) {
        SCOPED_TRACE(name);
        const auto all = cases();
        const auto found =
            std::find_if(all.begin(), all.end(), [&](const Case& c) { return std::string(c.name) == name; });
        plan.max_order = 0;
        const Table cut = measure(surface, found->material, plan).table;
        plan.max_order = 60;
        const Table whole = measure(surface, found->material, plan).table;
        double squares = 0;
        for (size_t k = 0; k < cut.f.size(); ++k)
            squares += std::pow(cut.f[k] / whole.f[k] - 1, 2) / static_cast<double>(cut.f.size());
        EXPECT_LT(std::sqrt(squares), 5e-6);
    }
}

// The mean over receiver cells, from directions inside them and from where traced light ends.
TEST(GlossyAgreement, EveryTransportAnswersCells) {
    const HeightField surface = generate_gaussian(48, 40, 1e-6, 4e-6, 0.7, 12);
    Microfacet brushed;
    brushed.alpha_x = 0.3;
    brushed.alpha_y = 0.6;
    brushed.rotation_deg = 25.0;
    brushed.reflectance.reflectance = 1.0;
    for (const auto& [kind, material] : {std::pair{TransportKind::diffuse, Material({"y"}, Lambertian{0.8})},
                                         {TransportKind::pair_graph, Material({"y"}, brushed)}}) {
        BrdfPlan plan;
        plan.incident = {{15, 40}, {50, 200}, {70, 95}};
        plan.outgoing_cells = equal_cells(24);
        plan.outgoing = centres(plan.outgoing_cells);
        plan.separate_orders = true;
        plan.max_order = 3;
        plan.transport = kind;
        plan.accuracy.samples = Accuracy::Samples{8, 144, 1, 8};
        const Table own = measure(surface, material, plan).table;
        plan.transport = TransportKind::forward;
        plan.accuracy.samples = Accuracy::Samples{8, 64, 1, 12};
        const Table traced = measure(surface, material, plan).table;
        double squares = 0;
        for (size_t k = 0; k < own.f.size(); ++k) {
            const double sigma = std::hypot(doubt(own, k), doubt(traced, k)) + 1e-6;
            EXPECT_NEAR(own.f[k], traced.f[k], 5 * sigma) << "value " << k;
            squares += std::pow((own.f[k] - traced.f[k]) / sigma, 2);
        }
        EXPECT_LT(squares / static_cast<double>(own.f.size()), 1.6);
    }
}

}  // namespace
}  // namespace gonio
