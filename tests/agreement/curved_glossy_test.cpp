// Glossy facets on curved bases against paths traced by Embree through reliefs that are really displaced from
// cylinders and spheres.
#include "agreement/curved_glossy.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "agreement/measured.h"
#include "measure/reference.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

struct BaseCase {
    const char* name;
    BaseCurvature base;
};

std::vector<std::pair<const char*, Material>> materials() {
    Microfacet ggx;
    ggx.alpha_x = ggx.alpha_y = 0.3;
    ggx.reflectance.reflectance = 1.0;
    Material mixture({"y"}, Lambertian{1.0});
    mixture.lobes.front().weight = 0.5;
    ggx.alpha_x = ggx.alpha_y = 0.2;
    mixture.lobes.push_back({0.5, ggx});
    ggx.alpha_x = ggx.alpha_y = 0.3;
    return {{"ggx", {{"y"}, ggx}},
            {"mixture", mixture},
            {"phong", {{"y"}, Phong{20.0, 0.9}}},
            {"coated", {{"y"}, CoatedDiffuse{1.5, 0.3, 0.8}}}};
}

class CurvedGlossy : public ::testing::TestWithParam<BaseCase> {};

TEST_P(CurvedGlossy, OrdersOfScattering) {
    const HeightField surface = relief_on(GetParam().base);
    const auto owned = patches_of(surface);
    std::vector<CurvedPatch*> patches;
    for (const auto& p : owned) patches.push_back(p.get());
    constexpr int orders = 3;
    const int paths = std::getenv("PATHS") ? std::atoi(std::getenv("PATHS")) : 60000;
    const std::vector<AnglesDeg> lights{{0, 0}, {40, 70}, {65, 180}}, views{{20, 0}, {60, 130}};
    BrdfPlan plan = plan_of(lights, views, Accuracy::Samples{4, 256, 1, 8});
    plan.max_order = orders;
    plan.separate_orders = true;
    std::vector<Vec3> wi;
    for (const AnglesDeg& light : lights) wi.push_back(to_vector(light));
    for (const auto& [name, material] : materials()) {
        SCOPED_TRACE(name);
        const Table table = measure(surface, material, plan).table;
        std::vector<std::vector<double>> pulls(orders);
        std::vector<double> of_order(orders), traced_of_order(orders), doubt_of_order(orders);
        for (size_t v = 0; v < views.size(); ++v) {
            const auto traced =
                trace_glossy(patches, material, wi, to_vector(views[v]), orders, paths, 300 + v);
            for (size_t l = 0; l < lights.size(); ++l)
                for (int k = 0; k < orders; ++k) {
                    const size_t at = table.index(0, k + 1, l * views.size() + v);
                    const TracedOrders::Value& truth = traced[l].orders[k];
                    pulls[k].push_back((table.f[at] - truth.mean) / std::hypot(doubt(table, at), truth.se));
                    of_order[k] += table.f[at];
                    traced_of_order[k] += truth.mean;
                    doubt_of_order[k] += truth.se * truth.se + std::pow(doubt(table, at), 2);
                    if (std::getenv("ROWS"))
                        std::printf("   l %zu v %zu order %d: %.5f (%.5f), traced %.5f (%.5f) %+.1f\n", l, v,
                                    k + 1, table.f[at], doubt(table, at), truth.mean, truth.se,
                                    pulls[k].back());
                }
        }
        for (int k = 0; k < orders; ++k) {
            std::printf("%s %s order %d: %+.2f %% (%.2f), rms %.2f sigma\n", GetParam().name, name, k + 1,
                        100 * (of_order[k] / traced_of_order[k] - 1),
                        100 * std::sqrt(doubt_of_order[k]) / traced_of_order[k], reference::rms(pulls[k]));
            const double bound = reference::sidak_sigmas(pulls[k].size() * orders * 4);
            for (const double pull : pulls[k]) EXPECT_LT(std::abs(pull), bound) << "order " << k + 1;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Bases, CurvedGlossy,
                         ::testing::Values(BaseCase{"cylinder", {1.0 / 60, 0, radians(30)}},
                                           BaseCase{"sphere", {1.0 / 80, 1.0 / 80, 0}},
                                           BaseCase{"hollow", {-1.0 / 200, 0, 0}}),
                         [](const auto& param_case) { return std::string(param_case.param.name); });

}  // namespace
}  // namespace gonio
