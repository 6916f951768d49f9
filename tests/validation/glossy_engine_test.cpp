// The glossy engine against closed forms and the reference answers for glossy grooves.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "material/facet_brdf.h"
#include "surface/generate.h"
#include "validation/load_json.h"

namespace gonio {
namespace {

Material glossy(double alpha, double reflectance = 1) {
    Microfacet m;
    m.alpha_x = m.alpha_y = alpha;
    m.reflectance.reflectance = reflectance;
    return {{"y"}, m};
}

AnglesDeg angles(const nlohmann::json& pair) {
    return {pair[0].get<double>(), pair[1].get<double>()};
}

// The reference's name for a facet material; nothing for what gonio has no lobe for.
std::optional<Material> named(const nlohmann::json& micro) {
    const std::string type = micro["type"];
    const double strength = micro.value("F", micro.value("F_or_ks", 1.0));
    if (micro.value("G", std::string("smith height-correlated")) != "smith height-correlated")
        return std::nullopt;
    if (type == "lambert") return Material({"y"}, Lambertian{micro.value("rho", 1.0)});
    if (type == "ggx") return glossy(micro["alpha"], strength);
    if (type == "beckmann") {
        Microfacet m;
        m.distribution = Microfacet::Distribution::beckmann;
        m.alpha_x = m.alpha_y = micro["alpha"].get<double>();
        m.reflectance.reflectance = strength;
        return Material({"y"}, m);
    }
    return std::nullopt;
}

BrdfPlan graph_plan(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing,
                    Accuracy::Samples samples) {
    BrdfPlan plan = plan_of(std::move(incident), std::move(outgoing), samples);
    plan.transport = TransportKind::pair_graph;
    return plan;
}

TEST(GlossyEngine, DirectLightOfAGlossyGroove) {
    const nlohmann::json answers = reference::load_json("vgroove_a45_glossy_direct");
    const HeightField groove = generate_v_groove(64, 2.0, 45);
    int compared = 0;
    for (const auto& entry : answers["entries"]) {
        const auto material = named(entry["micro"]);
        if (!material) continue;
        BrdfPlan plan = graph_plan({angles(entry["wi"])}, {angles(entry["wo"])}, {64, 16, 1, 6});
        plan.max_order = 1;
        const Table table = measure(groove, *material, plan).table;
        const double expected = entry["value"];
        EXPECT_NEAR(table.f[0], expected, 4 * doubt(table, 0) + 1e-4 * expected + 1e-9)
            << entry["micro"] << entry["wi"] << entry["wo"];
        EXPECT_LT(doubt(table, 0), 0.004 * expected + 1e-9);
        ++compared;
    }
    EXPECT_GE(compared, 20);
}

TEST(GlossyEngine, AllOrdersInAGlossyGroove) {
    const nlohmann::json answers = reference::load_json("vgroove_glossy_multibounce");
    int compared = 0;
    double squares = 0;
    for (const auto& entry : answers["entries"]) {
        const auto material = named(entry["micro"]);
        if (!material) continue;
        const HeightField groove = generate_v_groove(64, 2.0, entry["alpha_deg"]);
        BrdfPlan plan = graph_plan({angles(entry["wi"])}, {angles(entry["wo"])}, {64, 256, 1, 6});
        plan.separate_orders = true;
        const Table table = measure(groove, *material, plan).table;
        const auto compare = [&](size_t slice, double expected, double uncertainty) {
            const size_t k = table.index(0, slice, 0);
            const double sigma = std::hypot(doubt(table, k), uncertainty / 2);
            EXPECT_NEAR(table.f[k], expected, 4 * sigma + 1e-7)
                << entry["micro"] << entry["wi"] << entry["wo"] << " slice " << slice;
            EXPECT_LT(doubt(table, k), 0.01 * entry["total"].get<double>());
            squares += std::pow((table.f[k] - expected) / (sigma + 1e-7), 2);
            ++compared;
        };
        compare(0, entry["total"], entry["uncertainty"]);
        compare(2, entry["second_order"], entry["uncertainty_second"]);
    }
    EXPECT_GE(compared, 16);
    EXPECT_LT(squares / compared, 2.5);
}

// Forced through the engine, a plane gives the facet material itself: nothing is sampled that varies.
TEST(GlossyEngine, APlaneIsItsFacet) {
    const HeightField plane = generate_plane(32, 1e-3);
    Microfacet gold;
    gold.alpha_x = 0.15, gold.alpha_y = 0.4;
    gold.rotation_deg = 20.0;
    gold.reflectance.eta = {0.18, 0.42, 1.4};
    gold.reflectance.k = {3.4, 2.3, 1.9};
    Material material({"r", "g", "b"}, gold);
    material.lobes.front().weight = 0.7;
    material.lobes.push_back({0.3, CoatedDiffuse{1.5, 0.1, {0.2, 0.5, 0.9}}});
    const auto directions = equal_projected_hemisphere(9);
    const Table table = measure(plane, material, graph_plan(directions, directions, {1, 16, 1, 6}), false).table;
    const FacetBrdf facet(material, plane, 0, 3, 3);
    for (size_t row = 0; row < table.rows(); ++row) {
        std::vector<double> f(3);
        facet.eval(to_vector(table.incident[table.pair(row).first]),
                   to_vector(table.outgoing[table.pair(row).second]), f);
        for (size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(table.f[table.index(c, 0, row)], f[c], 2e-4 * f[c]) << "row " << row << " channel " << c;
    }
}

TEST(GlossyEngine, LambertThroughTheGraphIsTheDiffuseOperators) {
    const HeightField surface = generate_gaussian(64, 64, 1e-6, 5e-6, 0.7, 4);
    const Material material({"r", "g"}, Lambertian{{0.9, 0.3}});
    const auto directions = equal_projected_hemisphere(12);
    BrdfPlan plan = graph_plan(directions, directions, {4, 128, 1, 8});
    plan.separate_orders = true;
    plan.max_order = 4;
    const Table graph = measure(surface, material, plan).table;
    plan.transport = TransportKind::diffuse;
    const Table diffuse = measure(surface, material, plan).table;
    expect_tables_agree(graph, diffuse, 5);
    for (size_t slice : {0, 2}) {
        double off = 0, sum = 0;
        for (size_t row = 0; row < graph.rows(); ++row) {
            off += graph.f[graph.index(0, slice, row)] - diffuse.f[graph.index(0, slice, row)];
            sum += diffuse.f[graph.index(0, slice, row)];
        }
        EXPECT_LT(std::abs(off / sum), 2e-3) << "slice " << slice;
    }
}

// One measurement of f and one with lights and views exchanged, and no symmetry put in by hand.
TEST(GlossyEngine, IsReciprocalAndKeepsEnergy) {
    const HeightField surface = generate_gaussian(64, 64, 1e-6, 5e-6, 0.7, 9);
    Material material = glossy(0.3);
    material.lobes.front().weight = 0.5;
    material.lobes.push_back({0.5, Lambertian{1.0}});
    const auto lights = equal_projected_hemisphere(10);
    const std::vector<AnglesDeg> views{{10, 30}, {55, 100}, {70, 310}};
    const Table there = measure(surface, material, graph_plan(lights, views, {2, 128, 1, 6})).table,
                back = measure(surface, material, graph_plan(views, lights, {2, 128, 1, 6})).table;
    for (size_t l = 0; l < lights.size(); ++l)
        for (size_t v = 0; v < views.size(); ++v) {
            const size_t a = l * views.size() + v, b = v * lights.size() + l;
            EXPECT_NEAR(there.f[a], back.f[b], 5 * std::hypot(doubt(there, a), doubt(back, b)));
        }
    // Directions of equal projected solid angle: the mean of f times pi is the albedo.
    const auto hemisphere = equal_projected_hemisphere(256);
    const Table whole = measure(surface, material, graph_plan({{50, 20}}, hemisphere, {1, 64, 1, 6})).table;
    double albedo = 0;
    for (const float f : whole.f) albedo += pi * f / static_cast<double>(whole.f.size());
    EXPECT_LT(albedo, 1.0);
    EXPECT_GT(albedo, 0.9);  // GGX of one order loses some
}

TEST(GlossyEngine, SameBitsOnAnyNumberOfThreads) {
    const HeightField surface = generate_gaussian(48, 40, 1e-6, 5e-6, 0.7, 2);
    const auto directions = equal_projected_hemisphere(7);
    BrdfPlan plan = graph_plan(directions, {{10, 30}, {55, 100}}, {3, 48, 2, 2});
    plan.accuracy.samples->directions = 64;
    const Table one = measure(surface, glossy(0.2), plan, true, 1).table,
                three = measure(surface, glossy(0.2), plan, true, 3).table;
    EXPECT_EQ(one.f, three.f);
    EXPECT_EQ(one.se, three.se);
}

// Windows of a large surface see what the whole period does.
TEST(GlossyEngine, WindowsAgreeWithTheWholePeriod) {
    const HeightField surface = generate_gaussian(320, 320, 1e-6, 6e-6, 0.6, 5);
    BrdfPlan windows = plan_for_target({{20, 0}, {60, 40}}, {{35, 200}}, 0.03);
    windows.transport = TransportKind::pair_graph;
    const BrdfResult seen = measure(surface, glossy(0.35), windows);
    EXPECT_TRUE(was_skipped(seen.report, "most receivers"));
    EXPECT_TRUE(seen.report.target_met);
    const Table whole =
        measure(surface, glossy(0.35), graph_plan({{20, 0}, {60, 40}}, {{35, 200}}, {1, 96, 1, 4})).table;
    expect_tables_agree(seen.table, whole, 4);
}

TEST(GlossyEngine, OrdersAndColoursAddUp) {
    const HeightField surface = generate_gaussian(32, 32, 1e-6, 4e-6, 0.8, 6);
    Microfacet coloured;
    coloured.alpha_x = coloured.alpha_y = 0.4;
    coloured.reflectance.reflectance = {1.0, 0.5};
    const Material material({"r", "g"}, coloured);
    BrdfPlan plan = graph_plan({{40, 10}}, {{20, 100}, {60, 190}}, {2, 64, 1, 4});
    plan.separate_orders = true;
    plan.max_order = 3;
    const Table table = measure(surface, material, plan).table;
    ASSERT_EQ(table.orders, 3);
    for (size_t c = 0; c < 2; ++c)
        for (size_t row = 0; row < 2; ++row) {
            double sum = 0;
            for (size_t order = 1; order <= 3; ++order) {
                const double f = table.f[table.index(c, order, row)];
                sum += f;
                if (c == 1) {
                    EXPECT_NEAR(f, std::pow(0.5, order) * table.f[table.index(0, order, row)], 1e-5 * f);
                }
            }
            EXPECT_NEAR(table.f[table.index(c, 0, row)], sum, 1e-5 * sum);
        }
    plan.separate_orders = false;
    const Table sum = measure(surface, material, plan).table;
    for (size_t c = 0; c < 2; ++c)
        for (size_t row = 0; row < 2; ++row)
            EXPECT_NEAR(sum.f[sum.index(c, 0, row)], table.f[table.index(c, 0, row)],
                        1e-4 * table.f[table.index(c, 0, row)]);
}

}  // namespace
}  // namespace gonio
