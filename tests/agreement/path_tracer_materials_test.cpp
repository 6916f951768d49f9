// The judge judged on facets that are not Lambertian: closed forms and reference answers, within its own
// standard errors.
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "directions/cells.h"
#include "directions/gonio_grid.h"
#include "material/facet_brdf.h"
#include "measure/reference.h"
#include "surface/generate.h"
#include "validation/reference_data.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

Table trace(const HeightField& surface, const Material& material, const BrdfPlan& plan, long long paths,
            uint64_t seed = 1) {
    BrdfPlan seeded = plan;
    seeded.accuracy.seed = seed;
    return measure_reference(surface, material, seeded, {paths}, {}).table;
}

BrdfPlan pair_plan(const std::vector<std::pair<AnglesDeg, AnglesDeg>>& pairs) {
    BrdfPlan plan;
    for (const auto& [wi, wo] : pairs) {
        plan.pairs.emplace_back(plan.incident.size(), plan.outgoing.size());
        plan.incident.push_back(wi);
        plan.outgoing.push_back(wo);
    }
    return plan;
}

BrdfPlan in_orders(BrdfPlan plan, int orders) {
    plan.max_order = orders;
    plan.separate_orders = true;
    return plan;
}

// Off by how many standard errors, beside `sigma` of what it is compared with.
double pull(const Table& table, size_t k, double value, double sigma = 0) {
    const double off = table.f[k] - value;
    if (std::abs(off) <= 1e-6 * std::max(1.0, value)) return 0;  // floats
    return off / std::hypot(table.se[k], sigma);
}

void expect_within(const std::vector<double>& pulls, const std::string& what) {
    const double bound = reference::sidak_sigmas(pulls.size());
    for (size_t k = 0; k < pulls.size(); ++k)
        EXPECT_LT(std::abs(pulls[k]), bound) << what << ", deviation " << k << " of " << pulls.size();
    if (pulls.size() >= 10) {
        EXPECT_LT(reference::rms(pulls), 1.5) << what;
    }
}

Lobe ggx(double alpha_x, double alpha_y, double rotation_deg = 0,
         SpecularReflectance reflectance = {1.0, {}, {}}) {
    return Microfacet{Microfacet::Distribution::ggx, alpha_x, alpha_y, rotation_deg, std::move(reflectance)};
}

// Everything at once: crossings of diffuse and glossy, anisotropy, colour, Fresnel.
Material mixed() {
    Material material;
    material.channels = {"a", "b"};
    material.lobes = {{0.4, Lambertian{{0.9, 0.3}}},
                      {{0.3, 0.4}, ggx(0.3, 0.5, 40, {{}, {0.2, 1.4}, {3.5, 1.9}})},
                      {0.2, CoatedDiffuse{1.5, 0.3, {0.2, 0.9}}}};
    return material;
}

TEST(PathTracerMaterials, PlanesAreExact) {
    const HeightField plane = generate_plane(4, 1e-3);
    BrdfPlan plan;
    plan.incident = product_grid({0, 45, 80}, {0, 120});
    plan.outgoing = product_grid({10, 80}, {0, 77});
    const Material material = mixed();
    const Table table = trace(plane, material, plan, 8);
    std::vector<double> f(2);
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        FacetBrdf(material, plane, 0, 0, 0).eval(to_vector(plan.incident[i]), to_vector(plan.outgoing[o]), f);
        for (size_t c = 0; c < 2; ++c) EXPECT_NEAR(table.f[table.index(c, 0, row)], f[c], 2e-6 * (1 + f[c]));
    }
}

TEST(PathTracerMaterials, VGroovesDirect) {
    const HeightField groove = generate_v_groove(8, 2, 45);
    const nlohmann::json document = reference::load_json("vgroove_a45_glossy_direct");
    std::vector<double> pulls;
    for (const auto& entry : document.at("entries")) {
        const BrdfPlan plan = in_orders(
            pair_plan({{reference::angles_of(entry.at("wi")), reference::angles_of(entry.at("wo"))}}), 1);
        const Table table = trace(groove, {{"y"}, *reference::lobe_of(entry.at("micro"))}, plan, 8192);
        const double value = entry.at("value");
        EXPECT_LT(table.se[0], 0.01 * value + 1e-9);
        pulls.push_back(pull(table, 0, value));
    }
    EXPECT_EQ(pulls.size(), 39u);
    expect_within(pulls, "direct");
}

TEST(PathTracerMaterials, VGroovesOfAllOrders) {
    const HeightField groove = generate_v_groove(8, 2, 45);
    const nlohmann::json document = reference::load_json("vgroove_glossy_multibounce");
    std::vector<double> pulls;
    for (const auto& entry : document.at("entries")) {
        EXPECT_EQ(entry.at("alpha_deg"), 45);
        const Material material({"y"}, *reference::lobe_of(entry.at("micro")));
        const BrdfPlan plan =
            pair_plan({{reference::angles_of(entry.at("wi")), reference::angles_of(entry.at("wo"))}});
        const Table total = trace(groove, material, plan, 40000);
        const Table single = trace(groove, material, in_orders(plan, 2), 40000, 2);
        pulls.push_back(pull(total, 0, entry.at("total"), entry.at("uncertainty").get<double>() / 2));
        pulls.push_back(pull(single, single.index(0, 2, 0), entry.at("second_order"),
                             entry.at("uncertainty_second").get<double>() / 2));
    }
    EXPECT_EQ(pulls.size(), 32u);
    expect_within(pulls, "all orders");
}

// Two halves of one paint are not known to be Lambertian: evaluated and sampled as any material, they look
// alike.
TEST(PathTracerMaterials, LambertianTheGeneralWay) {
    const HeightField field = generate_gaussian(32, 32, 1, 4, 0.8, 3);
    const Material paint({"y"}, Lambertian{0.8});
    Material halves;
    halves.channels = {"y"};
    halves.lobes = {{0.5, Lambertian{0.8}}, {0.5, Lambertian{0.8}}};
    const BrdfPlan plan = in_orders(
        pair_plan({{{30, 0}, {20, 40}}, {{60, 100}, {50, 280}}, {{75, 10}, {10, 10}}, {{0, 0}, {70, 0}}}), 3);
    const Table a = trace(field, paint, plan, 20000), b = trace(field, halves, plan, 20000, 2);
    std::vector<double> pulls;
    for (size_t k = 0; k < a.f.size(); ++k) pulls.push_back(pull(b, k, a.f[k], a.se[k]));
    expect_within(pulls, "paint");
}

TEST(PathTracerMaterials, AreReciprocalAndHonest) {
    const HeightField field = generate_gaussian(32, 32, 1, 4, 0.8, 3);
    const std::vector<std::pair<AnglesDeg, AnglesDeg>> there = {
        {{30, 0}, {20, 40}}, {{60, 100}, {50, 280}}, {{70, 10}, {10, 10}}, {{5, 0}, {65, 200}}};
    std::vector<std::pair<AnglesDeg, AnglesDeg>> back;
    for (const auto& [wi, wo] : there) back.emplace_back(wo, wi);
    const Table a = trace(field, mixed(), pair_plan(there), 30000),
                b = trace(field, mixed(), pair_plan(back), 30000, 2);
    std::vector<double> pulls;
    for (size_t k = 0; k < a.f.size(); ++k) {
        pulls.push_back(pull(b, k, a.f[k], a.se[k]));
        EXPECT_LT(a.se[k], 0.05 * a.f[k]);
    }
    expect_within(pulls, "reciprocity");
}

// A channel is what it would be alone, though all are sampled at once; and orders add up.
TEST(PathTracerMaterials, ChannelsStandAlone) {
    const HeightField groove = generate_v_groove(8, 2, 60);
    Material alone;
    alone.channels = {"b"};
    alone.lobes = {{0.4, Lambertian{0.3}},
                   {0.4, ggx(0.3, 0.5, 40, {{}, 1.4, 1.9})},
                   {0.2, CoatedDiffuse{1.5, 0.3, 0.9}}};
    const BrdfPlan plan = in_orders(pair_plan({{{40, 10}, {30, 100}}, {{60, 0}, {50, 180}}}), 4);
    const Table both = trace(groove, mixed(), plan, 40000), one = trace(groove, alone, plan, 40000, 2);
    std::vector<double> pulls;
    for (size_t row = 0; row < 2; ++row) {
        double sum = 0;
        for (size_t slice = 0; slice <= 4; ++slice) {
            pulls.push_back(pull(both, both.index(1, slice, row), one.f[one.index(0, slice, row)],
                                 one.se[one.index(0, slice, row)]));
            if (slice > 0) sum += both.f[both.index(1, slice, row)];
        }
        EXPECT_NEAR(both.f[both.index(1, 0, row)], sum, 1e-6);
    }
    expect_within(pulls, "channel");
}

TEST(PathTracerMaterials, MirrorsNeedCells) {
    try {
        trace(generate_plane(2, 1), {{"y"}, Mirror{{1.0, {}, {}}}}, pair_plan({{{0, 0}, {0, 0}}}), 8);
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(error.field(), "/measure/outgoing");
        EXPECT_NE(std::string(error.what()).find("cells"), std::string::npos);
    }
}

// ---- receiver cells

BrdfPlan cell_plan(const std::vector<AnglesDeg>& incident, const std::vector<ReceiverCell>& cells) {
    BrdfPlan plan;
    plan.incident = incident;
    plan.outgoing_cells = cells;
    plan.outgoing = centres(cells);
    return plan;
}

size_t cell_with(const std::vector<ReceiverCell>& cells, const AnglesDeg& d) {
    for (size_t k = 0; k < cells.size(); ++k)
        if (d.theta_deg >= cells[k].theta_min_deg && d.theta_deg < cells[k].theta_max_deg)
            for (const double turn : {-360.0, 0.0, 360.0})
                if (d.phi_deg + turn >= cells[k].phi_min_deg && d.phi_deg + turn < cells[k].phi_max_deg)
                    return k;
    ADD_FAILURE() << "no cell";
    return 0;
}

TEST(PathTracerCells, MirrorOfAPlane) {
    const Material gold({"r", "g", "b"}, Mirror{{{}, {0.2, 0.5, 1.4}, {3.4, 2.4, 1.9}}});
    const std::vector<ReceiverCell> cells = klems_full_cells();
    const Table table =
        trace(generate_plane(4, 1), gold, cell_plan({{0, 0}, {40, 100}, {77, 3}}, cells), 512);
    for (size_t i = 0; i < 3; ++i) {
        const AnglesDeg& wi = table.incident[i];
        const size_t lit = cell_with(cells, {wi.theta_deg, wi.phi_deg + 180});
        std::vector<double> weight(3);
        FacetBrdf(gold, generate_plane(4, 1), 0, 0, 0).sample(to_vector(wi), 0, 0, 0, weight);
        for (size_t o = 0; o < cells.size(); ++o)
            for (size_t c = 0; c < 3; ++c) {
                const double f = o == lit ? weight[c] / projected_solid_angle(cells[o]) : 0.0;
                EXPECT_NEAR(table.f[table.index(c, 0, i * cells.size() + o)], f, 1e-5 * f) << i << " " << o;
            }
    }
}

// Two walls at right angles send light back in the plane across them, after two bounces.
TEST(PathTracerCells, MirrorGrooveReflectsBack) {
    const Material mirror({"y"}, Mirror{{0.9, {}, {}}});
    const std::vector<ReceiverCell> cells = klems_full_cells();
    const Table table =
        trace(generate_v_groove(8, 2, 45), mirror, in_orders(cell_plan({{0, 0}, {20, 90}}, cells), 3), 8192);
    for (size_t i = 0; i < 2; ++i) {
        const AnglesDeg& wi = table.incident[i];
        const size_t lit = cell_with(cells, {wi.theta_deg, wi.phi_deg + 180});
        for (size_t o = 0; o < cells.size(); ++o)
            for (const size_t order : {1, 2, 3}) {
                const double f = o == lit && order == 2 ? 0.81 / projected_solid_angle(cells[o]) : 0.0;
                EXPECT_NEAR(table.f[table.index(0, order, i * cells.size() + o)], f, 1e-4 * f + 1e-9)
                    << i << " " << o;
            }
    }
    // After one bounce all light is still inside.
    const Table first =
        trace(generate_v_groove(8, 2, 45), mirror, in_orders(cell_plan({{0, 0}}, cells), 1), 512);
    for (const float f : first.f) EXPECT_EQ(f, 0);
}

// Nothing is absorbed: what arrives leaves into the cells.
TEST(PathTracerCells, WhiteMirrorsKeepAllLight) {
    const HeightField field = generate_gaussian(32, 32, 1, 4, 0.8, 3);
    const std::vector<ReceiverCell> cells = equal_cells(64);
    const Table table =
        trace(field, {{"y"}, Mirror{{1.0, {}, {}}}}, cell_plan({{10, 0}, {70, 40}}, cells), 20000);
    for (size_t i = 0; i < 2; ++i) {
        double sum = 0;
        for (size_t o = 0; o < cells.size(); ++o)
            sum += projected_solid_angle(cells[o]) * table.f[i * cells.size() + o];
        EXPECT_NEAR(sum, 1, 1e-4);
    }
}

TEST(PathTracerCells, HalfMirrorHalfPaint) {
    Material material;
    material.channels = {"y"};
    material.lobes = {{0.5, Mirror{{0.8, {}, {}}}}, {0.5, Lambertian{0.6}}};
    const std::vector<ReceiverCell> cells = equal_cells(32);
    const Table table = trace(generate_plane(4, 1), material, cell_plan({{30, 10}}, cells), 40000);
    const size_t lit = cell_with(cells, {30, 190});
    std::vector<double> pulls;
    for (size_t o = 0; o < cells.size(); ++o)
        pulls.push_back(pull(table, o, 0.3 / pi + (o == lit ? 0.4 / projected_solid_angle(cells[o]) : 0.0)));
    expect_within(pulls, "half mirror");
}

// Light into cells against views out of them: other paths, the same mean.
TEST(PathTracerCells, AreMeansOverDirections) {
    const HeightField field = generate_gaussian(32, 32, 1, 4, 0.8, 3);
    const std::vector<ReceiverCell> cells = equal_cells(12);
    const Table binned = trace(field, mixed(), in_orders(cell_plan({{40, 20}}, cells), 2), 300000);
    BrdfPlan plan;
    plan.incident = {{40, 20}};
    constexpr int side = 6, n = side * side;
    for (const ReceiverCell& cell : cells)
        for (int k = 0; k < n; ++k) {
            const Vec3 d = direction_in(cell, (k / side + 0.5) / side, (k % side + 0.5) / side);
            plan.outgoing.push_back({degrees(std::acos(d.z)), degrees(std::atan2(d.y, d.x))});
        }
    const Table viewed = trace(field, mixed(), in_orders(plan, 2), 1000, 2);
    std::vector<double> pulls;
    for (size_t c = 0; c < 2; ++c)
        for (size_t slice = 0; slice <= 2; ++slice)
            for (size_t o = 0; o < cells.size(); ++o) {
                double mean = 0, squares = 0;
                for (int k = 0; k < n; ++k) {
                    const double f = viewed.f[viewed.index(c, slice, o * n + k)];
                    mean += f / n;
                    squares += f * f / n;
                }
                // What a random sample of n directions would leave: more than these do.
                pulls.push_back(pull(binned, binned.index(c, slice, o), mean,
                                     std::sqrt(std::max(0.0, squares - mean * mean) / n)));
            }
    expect_within(pulls, "cells");
}

}  // namespace
}  // namespace gonio
