// Facets with hostile numbers on a relief, by every transport: right where an answer is known, sound
// everywhere, or refused with the reason.
#include <gtest/gtest.h>

#include <limits>

#include "agreement/measured.h"
#include "surface/generate.h"

namespace gonio {
namespace {

const std::vector<AnglesDeg> lights = {{0, 0}, {40, 20}, {70, 250}};
const std::vector<AnglesDeg> views = {{15, 100}, {60, 310}};

HeightField relief() {
    return generate_gaussian(24, 24, 1e-6, 5e-6, 0.7, 8);
}

Material rough(double alpha, SpecularReflectance reflectance,
               Microfacet::Distribution distribution = Microfacet::Distribution::ggx) {
    return {{"y"}, Microfacet{distribution, alpha, alpha, 0.0, std::move(reflectance)}};
}
Material mirror(SpecularReflectance reflectance) {
    return {{"y"}, Mirror{std::move(reflectance)}};
}

Table at_directions(const Material& material, int directions = 64) {
    return measure(relief(), material, plan_of(lights, views, Accuracy::Samples{2, directions, 1, 4})).table;
}

BrdfPlan cell_plan(int sub_samples = 2) {
    BrdfPlan plan = plan_of(lights, {}, Accuracy::Samples{sub_samples, 64, 1, 6});
    plan.outgoing_cells = equal_cells(16);
    plan.outgoing = centres(plan.outgoing_cells);
    plan.transport = TransportKind::forward;
    return plan;
}
Table in_cells(const Material& material) {
    return measure(relief(), material, cell_plan()).table;
}

// Reflected in all, relative to what comes from a light, less what noise may add.
double reflected(const Table& table, size_t light) {
    double sum = 0, variance = 0;
    for (size_t cell = 0; cell < table.cells.size(); ++cell) {
        const size_t k = light * table.cells.size() + cell;
        sum += table.f[k] * projected_solid_angle(table.cells[cell]);
        variance += std::pow(table.se[k] * projected_solid_angle(table.cells[cell]), 2);
    }
    return sum - 4 * std::sqrt(variance);
}

TEST(MaterialStress, NoNumberMakesLightOrNoise) {
    using enum Microfacet::Distribution;
    const SpecularReflectance white{1.0, {}, {}}, glass{{}, 1.5, 0.0}, dense{{}, 1e6, 1e6},
        thin{{}, 1e-6, 0.0};
    const std::vector<std::pair<const char*, Material>> materials{
        {"ggx 1e-6", rough(1e-6, white)},
        {"ggx 1e-4", rough(1e-4, white)},
        {"beckmann 1e-4", rough(1e-4, white, beckmann)},
        {"ggx 1", rough(1, white)},
        {"beckmann 1", rough(1, white, beckmann)},
        {"glass", rough(0.3, glass)},
        {"index 1e6", rough(0.3, dense)},
        {"index 1e-6", rough(0.3, thin)},
        {"brushed", {{"y"}, Microfacet{ggx, 1e-4, 1.0, 360.0, white}}},
        {"phong 0", {{"y"}, Phong{0.0, 1.0}}},
        {"phong 1e6", {{"y"}, Phong{1e6, 1.0}}},
        {"blinn 0", {{"y"}, BlinnPhong{0.0, 1.0}}},
        {"blinn 1e6", {{"y"}, BlinnPhong{1e6, 1.0}}},
        {"coat 1", {{"y"}, CoatedDiffuse{1.0, 1.0, 1.0}}},
        {"coat 1e6", {{"y"}, CoatedDiffuse{1e6, 1e-6, 1.0}}},
        {"coat 1.5 white", {{"y"}, CoatedDiffuse{1.5, 1e-4, 1.0}}}};
    for (const auto& [name, material] : materials) {
        SCOPED_TRACE(name);
        at_directions(material);  // finite, not negative: measure() looks
        const Table cells = in_cells(material);
        for (size_t light = 0; light < lights.size(); ++light) EXPECT_LT(reflected(cells, light), 1 + 1e-5);
    }
}

// Where a number leaves nothing of a lobe, or all of it, the answer is that of a simpler one.
TEST(MaterialStress, LimitsAreSimplerMaterials) {
    const SpecularReflectance air{{}, 1.0, 0.0}, dense{{}, 1e6, 0.0}, white{1.0, {}, {}};
    // Nothing changes at the surface: nothing is reflected.
    for (const Table& table :
         {at_directions(rough(0.3, air)), in_cells(rough(0.3, air)), in_cells(mirror(air))})
        for (const float f : table.f) EXPECT_NEAR(f, 0, 1e-12);
    for (const Table& table : {at_directions(gray({0})), in_cells(mirror({0.0, {}, {}}))})
        for (const float f : table.f) EXPECT_EQ(f, 0);
    // An index of a million reflects 1 - 4e-6 of all light.
    expect_tables_near(at_directions(rough(0.3, dense)), at_directions(rough(0.3, white)), 1e-4);
    expect_tables_near(in_cells(mirror(dense)), in_cells(mirror(white)), 1e-4);
    // A coat of the index of air is none.
    BrdfPlan plan = plan_of(lights, views, Accuracy::Samples{8, 256, 1, 8});
    plan.transport = TransportKind::pair_graph;
    expect_tables_agree(measure(relief(), {{"y"}, CoatedDiffuse{1.0, 0.3, 0.6}}, plan).table,
                        measure(relief(), gray({0.6}), plan).table, 5);
    // A lobe of alpha 1e-4 is a mirror to receivers of finite size.
    BrdfPlan fine = cell_plan(16);
    fine.outgoing_cells = equal_cells(8);
    fine.outgoing = centres(fine.outgoing_cells);
    const Table narrow = measure(relief(), rough(1e-4, white), fine).table,
                mirrored = measure(relief(), mirror(white), fine).table;
    for (size_t k = 0; k < narrow.f.size(); ++k)
        EXPECT_NEAR(narrow.f[k], mirrored.f[k],
                    5 * std::hypot(doubt(narrow, k), doubt(mirrored, k)) + 1e-3 * mirrored.f[k]);
}

// Lobes narrower than the shared directions are dense: said, not passed over.
TEST(MaterialStress, NarrowLobesAtDirectionsAreWarnedOf) {
    const BrdfPlan plan = plan_of(lights, views, Accuracy::Samples{2, 64, 1, 4});
    const auto warned = [&](const Material& material) {
        const Report report = measure(relief(), material, plan).report;
        return std::any_of(report.warnings.begin(), report.warnings.end(), [](const std::string& text) {
            return text.find("narrower than the shared directions") != std::string::npos;
        });
    };
    // At 1e-4 no pair meets a lobe: what was met says nothing.
    for (const double alpha : {1e-6, 1e-4, 0.01, 0.05}) EXPECT_TRUE(warned(rough(alpha, {1.0, {}, {}})));
    EXPECT_TRUE(warned({{"y"}, Phong{1e4, 0.5}}));
    EXPECT_TRUE(warned({{"y"}, CoatedDiffuse{1.5, 1e-3, 0.8}}));
    for (const double alpha : {0.4, 1.0}) EXPECT_FALSE(warned(rough(alpha, {1.0, {}, {}})));
    EXPECT_FALSE(warned({{"y"}, CoatedDiffuse{1.5, 0.3, 0.8}}));
}

TEST(MaterialStress, WhatIsNoFacetIsRefused) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const SpecularReflectance white{1.0, {}, {}};
    const auto refused = [](const Material& material, const std::string& field, const BrdfPlan& plan) {
        try {
            measure_brdf(relief(), material, plan, {});
            ADD_FAILURE() << "not refused: " << field;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::invalid_input);
            EXPECT_EQ(error.field(), field);
            EXPECT_FALSE(error.allowed().empty());
        }
    };
    std::vector<std::pair<Material, std::string>> cases;
    for (const double alpha : {0.0, 9e-7, 1.01, -0.3, nan})
        cases.push_back({rough(alpha, white), "/material/alpha_x"});
    for (const double eta : {0.0, 1.1e6, -1.0, nan}) {
        cases.push_back({rough(0.3, {{}, eta, 1.0}), "/material/eta"});
        cases.push_back({mirror({{}, eta, 1.0}), "/material/eta"});
        cases.push_back({{{"y"}, CoatedDiffuse{eta, 0.3, 0.5}}, "/material/eta"});
    }
    cases.push_back({{{"y"}, CoatedDiffuse{0.99, 0.3, 0.5}}, "/material/eta"});
    for (const double k : {-1e-9, 1.1e6, nan}) cases.push_back({rough(0.3, {{}, 1.0, k}), "/material/k"});
    for (const double share : {-1e-9, 1.001, nan}) {
        cases.push_back({rough(0.3, {share, {}, {}}), "/material/reflectance"});
        cases.push_back({mirror({share, {}, {}}), "/material/reflectance"});
        cases.push_back({{{"y"}, Phong{10.0, share}}, "/material/albedo"});
        cases.push_back({{{"y"}, BlinnPhong{10.0, share}}, "/material/albedo"});
        cases.push_back({{{"y"}, CoatedDiffuse{1.5, 0.3, share}}, "/material/albedo"});
    }
    for (const double exponent : {-1.0, 1.1e6, nan})
        cases.push_back({{{"y"}, Phong{exponent, 0.5}}, "/material/exponent"});
    // A map of another size, and one with a bad cell.
    cases.push_back({{{"y"}, Lambertian{Parameter::mapped(24, 23, std::vector<float>(24 * 23, 0.5f))}},
                     "/material/albedo"});
    cases.push_back({{{"y"}, Mirror{{Parameter::mapped(12, 48, std::vector<float>(24 * 24, 0.5f)), {}, {}}}},
                     "/material/reflectance"});
    std::vector<float> alphas(24 * 24, 0.3f);
    alphas[2 * 24 + 7] = 0;
    cases.push_back({{{"y"}, Microfacet{{}, Parameter::mapped(24, 24, alphas), 0.3, 0.0, white}},
                     "/material/alpha_x, column 7, row 2"});
    for (const auto& [material, field] : cases)
        for (const BrdfPlan& plan : {plan_of(lights, views), cell_plan()}) refused(material, field, plan);
}

// A thousand orders: those that there are, and nothing behind them.
TEST(MaterialStress, AThousandOrdersApart) {
    const HeightField groove = generate_v_groove(8, 8e-6, 45);
    const auto expect_orders = [&](const Material& material, BrdfPlan plan, TransportKind transport) {
        SCOPED_TRACE(static_cast<int>(transport));
        plan.transport = transport;
        plan.separate_orders = true;
        plan.max_order = 1000;
        const Table table = measure(groove, material, plan).table;
        ASSERT_EQ(table.orders, 1000);
        for (size_t row = 0; row < table.rows(); ++row) {
            double sum = 0;
            for (int order = 1; order <= 1000; ++order) sum += table.f[table.index(0, order, row)];
            const double whole = table.f[table.index(0, 0, row)];
            EXPECT_NEAR(sum, whole, 1e-4 * whole + doubt(table, table.index(0, 0, row)));
            EXPECT_EQ(table.f[table.index(0, 1000, row)], 0);
        }
    };
    const BrdfPlan directions = plan_of(lights, views, Accuracy::Samples{2, 64, 1, 3});
    expect_orders(gray({0.5}), directions, TransportKind::diffuse);
    expect_orders(rough(0.4, {0.9, {}, {}}), directions, TransportKind::pair_graph);
    expect_orders(mirror({0.9, {}, {}}), cell_plan(), TransportKind::forward);
}

}  // namespace
}  // namespace gonio
