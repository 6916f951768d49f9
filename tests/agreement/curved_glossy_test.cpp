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
    std::vector<const char*> materials;
};

// CTest's names of the tests: without it they hold the bytes of the parameter, other pointers every time, and
// CTest cannot remember what they cost.
void PrintTo(const BaseCase& base, std::ostream* out) {
    *out << base.name;
}

Material material_named(const std::string& name) {
    if (name == "phong") return {{"y"}, Phong{20.0, 0.9}};
    if (name == "coated") return {{"y"}, CoatedDiffuse{1.5, 0.3, 0.8}};
    Microfacet ggx;
    ggx.alpha_x = ggx.alpha_y = name == "ggx" ? 0.3 : 0.2;
    ggx.reflectance.reflectance = 1.0;
    if (name == "ggx") return {{"y"}, ggx};
    Material mixture({"y"}, Lambertian{1.0});
    mixture.lobes.front().weight = 0.5;
    mixture.lobes.push_back({0.5, ggx});
    return mixture;
}

class CurvedGlossy : public ::testing::TestWithParam<BaseCase> {};

TEST_P(CurvedGlossy, OrdersOfScattering) {
    const HeightField surface = relief_on(GetParam().base);
    const auto owned = patches_of(surface);
    std::vector<CurvedPatch*> patches;
    for (const auto& p : owned) patches.push_back(p.get());
    constexpr int orders = 3, paths = 150000;
    const std::vector<AnglesDeg> lights{{0, 0}, {40, 70}, {65, 180}}, views{{20, 0}, {60, 130}};
    BrdfPlan plan = plan_of(lights, views, Accuracy::Samples{4, 256, 1, 8});
    plan.max_order = orders;
    plan.separate_orders = true;
    std::vector<Vec3> wi;
    for (const AnglesDeg& light : lights) wi.push_back(to_vector(light));
    for (const char* name : GetParam().materials) {
        SCOPED_TRACE(name);
        const Table table = measure(surface, material_named(name), plan).table;
        std::vector<std::vector<double>> pulls(orders);
        std::vector<double> sum(orders), traced_sum(orders);
        for (size_t v = 0; v < views.size(); ++v) {
            const auto traced =
                trace_glossy(patches, material_named(name), wi, to_vector(views[v]), orders, paths, 300 + v);
            for (size_t l = 0; l < lights.size(); ++l)
                for (int k = 0; k < orders; ++k) {
                    const size_t at = table.index(0, k + 1, l * views.size() + v);
                    const TracedOrders::Value& truth = traced[l].orders[k];
                    pulls[k].push_back((table.f[at] - truth.mean) / std::hypot(doubt(table, at), truth.se));
                    sum[k] += table.f[at];
                    traced_sum[k] += truth.mean;
                }
        }
        for (int k = 0; k < orders; ++k) {
            std::printf("%s, %s, order %d: mean %+.2f %%, rms %.2f sigma\n", GetParam().name, name, k + 1,
                        100 * (sum[k] / traced_sum[k] - 1), reference::rms(pulls[k]));
            const double bound =
                reference::sidak_sigmas(pulls[k].size() * orders * GetParam().materials.size());
            for (const double pull : pulls[k]) EXPECT_LT(std::abs(pull), bound) << "order " << k + 1;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(
    Bases, CurvedGlossy,
    ::testing::Values(BaseCase{"cylinder", {1.0 / 60, 0, radians(30)}, {"ggx", "mixture", "phong", "coated"}},
                      BaseCase{"sphere", {1.0 / 80, 1.0 / 80, 0}, {"coated"}},
                      BaseCase{"hollow", {-1.0 / 200, 0, 0}, {"mixture"}}),
    [](const auto& param_case) { return std::string(param_case.param.name); });

double rms_pull(const Table& a, const Table& b, size_t slice) {
    std::vector<double> pulls;
    for (size_t row = 0; row < a.rows(); ++row) {
        const size_t at = a.index(0, slice, row);
        pulls.push_back((a.f[at] - b.f[at]) / std::hypot(doubt(a, at), doubt(b, at)));
    }
    return reference::rms(pulls);
}

// The graph and the operator carry light over a curved base by means of their own: on any base, where light
// turns about both directions, and into directions or cells.
TEST(CurvedGraph, CarriesTheLightOfLambertianFacetsAsTheOperatorDoes) {
    const HeightField surface = relief_on({1.0 / 60, -1.0 / 150, 0.4});
    const std::vector<AnglesDeg> angles{{0, 0}, {40, 70}, {65, 180}, {70, 290}, {50, 30}};
    BrdfPlan plan = plan_of(angles, angles, Accuracy::Samples{4, 288, 1, 12});
    plan.max_order = 3;
    plan.separate_orders = true;
    for (const bool cells : {false, true}) {
        if (cells) {
            plan.outgoing_cells = equal_cells(6);
            plan.outgoing = centres(plan.outgoing_cells);
        }
        plan.transport = TransportKind::automatic;
        const Table by_operator = measure(surface, gray({0.8}), plan).table;
        plan.transport = TransportKind::pair_graph;
        const Table by_graph = measure(surface, gray({0.8}), plan).table;
        for (size_t slice = 1; slice <= 3; ++slice)
            EXPECT_LT(rms_pull(by_graph, by_operator, slice), 1.6) << slice;
    }
}

// As curved_base_test has it for Lambertian facets: what is left is what bending hides and shows inside the
// relief.
// The bounds are those set there, before this was measured (0.31).
TEST(CurvedGraph, MovedDirectionsAgreeOnGentleBases) {
    const std::vector<AnglesDeg> lights{{0, 0}, {40, 70}, {65, 180}}, views{{5, 0}, {50, 20}, {70, 200}};
    BrdfPlan plan = plan_of(lights, views, Accuracy::Samples{4, 256, 1, 6});
    plan.max_order = 2;
    plan.separate_orders = true;
    auto table = [&](const BaseCurvature& base) {
        return measure(relief_on(base), material_named("mixture"), plan).table;
    };
    auto off = [&](const Table& a, const Table& b, size_t order) {
        double squares = 0, all = 0;
        for (size_t row = 0; row < a.rows(); ++row) {
            squares += std::pow(a.f[a.index(0, order, row)] - b.f[b.index(0, order, row)], 2);
            all += std::pow(b.f[b.index(0, order, row)], 2);
        }
        return std::sqrt(squares / all);
    };
    BaseCurvature base{1.0 / 120, 1.0 / 200, 0.4};
    const Table truth = table(base), flat = table({});
    base.correction = BaseCorrection::exact;
    const Table papers = table(base);
    for (const size_t order : {1u, 2u}) {
        std::printf("order %zu: off by %.4f, flat by %.4f\n", order, off(papers, truth, order),
                    off(flat, truth, order));
        EXPECT_LT(off(papers, truth, order), (order == 1 ? 0.05 : 0.4) * off(flat, truth, order));
    }
}

TEST(CurvedGraph, KappaToZeroIsTheFlatEngine) {
    const BrdfPlan plan = plan_for_target({{30, 0}, {70, 90}}, {{0, 0}, {60, 200}}, 0.01);
    expect_tables_agree(measure(relief_on({}), material_named("ggx"), plan).table,
                        measure(relief_on({1e-6, 1e-6, 0}), material_named("ggx"), plan).table, 4);
}

}  // namespace
}  // namespace gonio
