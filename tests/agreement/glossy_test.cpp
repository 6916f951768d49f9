// The glossy engine against the path tracer, which shares with it the relief and the plan alone.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace gonio
