// Identities that hold for every relief, as tests/validation/data/invariants.json lists them.
#include <gtest/gtest.h>

#include <random>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "surface/generate.h"
#include "validation/reference_data.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

const std::vector<AnglesDeg> lights = {{0, 0}, {35, 20}, {60, 130}, {78, 250}};
const std::vector<AnglesDeg> views = {{10, 200}, {50, 75}, {70, 310}};
const Accuracy::Samples some{4, 96, 1, 6}, many{16, 256, 1, 8};

HeightField white_noise() {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(0, 1.2e-3);
    std::vector<double> heights(32 * 32);
    for (double& h : heights) h = uniform(random);
    return make_height_field(32, 32, 1e-3, 1e-3, heights);
}

// The surfaces that the list recommends.
std::vector<std::pair<std::string, HeightField>> reliefs() {
    return {{"white noise", white_noise()},
            {"V-groove", generate_v_groove(16, 1e-3, 70)},
            {"pits", generate_spherical_pits(32, 1e-3, 0.35e-3, 80)},
            {"Gaussian", generate_gaussian(40, 48, 1e-4, 5e-4, 1, 7)}};
}

BrdfPlan in_orders(BrdfPlan plan, int orders) {
    plan.separate_orders = true;
    plan.max_order = orders;
    return plan;
}

BrdfPlan turned(BrdfPlan plan, double scale, double shift_deg) {
    for (auto* list : {&plan.incident, &plan.outgoing})
        for (AnglesDeg& a : *list) a.phi_deg = scale * a.phi_deg + shift_deg;
    return plan;
}

TEST(Invariants, ListIsTheOneTestedHere) {
    const nlohmann::json list = reference::load_json("invariants");
    std::vector<std::string> ids;
    for (const auto& entry : list.at("entries")) ids.push_back(entry.at("id"));
    // furnace_mirror waits for mirrors; furnace and projected_area are in diffuse_test.
    EXPECT_EQ(ids, (std::vector<std::string>{"furnace", "furnace_mirror", "order_sum", "energy_rho",
                                             "reciprocity", "rotation", "translation", "scale", "flat_limit",
                                             "projected_area", "retro_direct", "min_vis"}));
}

// Reciprocal for each order to rounding: one run for both sides, whatever its noise.
TEST(Invariants, ReciprocityOfEachOrder) {
    for (const auto& [name, surface] : reliefs()) {
        SCOPED_TRACE(name);
        const Table same = measure(surface, gray({0.9}), in_orders(plan_of(lights, lights, some), 4)).table;
        const int n = static_cast<int>(lights.size());
        for (size_t slice = 0; slice < same.slices(); ++slice)
            for (int i = 0; i < n; ++i)
                for (int o = 0; o < i; ++o) {
                    const float f = same.f[same.index(0, slice, i * n + o)];
                    EXPECT_NEAR(f, same.f[same.index(0, slice, o * n + i)], 2e-6 * f + 1e-9) << slice;
                }
        const Table forth = measure(surface, gray({0.9}), in_orders(plan_of(lights, views, some), 3)).table;
        const Table back = measure(surface, gray({0.9}), in_orders(plan_of(views, lights, some), 3)).table;
        for (size_t slice = 0; slice < forth.slices(); ++slice)
            for (size_t i = 0; i < lights.size(); ++i)
                for (size_t o = 0; o < views.size(); ++o) {
                    const float f = forth.f[forth.index(0, slice, i * views.size() + o)];
                    EXPECT_NEAR(f, back.f[back.index(0, slice, o * lights.size() + i)], 2e-6 * f + 1e-9)
                        << slice;
                }
    }
}

TEST(Invariants, OrdersAreNotNegativeAndSumUp) {
    for (const auto& [name, surface] : reliefs()) {
        SCOPED_TRACE(name);
        const Table table = measure(surface, gray({0.6}), in_orders(plan_of(lights, views, some), 5)).table;
        ASSERT_EQ(table.orders, 5);
        for (size_t row = 0; row < table.rows(); ++row) {
            double sum = 0;
            for (size_t k = 1; k <= 5; ++k) sum += table.f[table.index(0, k, row)];
            EXPECT_NEAR(table.f[row], sum, 3e-6 * sum);
        }
    }
}

// Directional albedo over an equal projected hemisphere: at most the albedo, and convex in it.
TEST(Invariants, EnergyIsConvexAndBelowTheAlbedo) {
    const std::vector<double> albedos = {0.25, 0.5, 0.75, 1.0};
    for (const auto& [name, surface] : reliefs()) {
        SCOPED_TRACE(name);
        const std::vector<AnglesDeg> hemisphere = equal_projected_hemisphere(400);
        const Table table = measure(surface, gray(albedos), plan_of(lights, hemisphere, some)).table;
        for (size_t l = 0; l < lights.size(); ++l) {
            double reflected[5] = {}, noise[5] = {};
            for (size_t c = 0; c < 4; ++c)
                for (size_t o = 0; o < hemisphere.size(); ++o) {
                    const size_t k = table.index(c, 0, l * hemisphere.size() + o);
                    reflected[c + 1] += table.f[k] * pi / static_cast<double>(hemisphere.size());
                    noise[c + 1] += doubt(table, k) * pi / static_cast<double>(hemisphere.size());
                }
            // The sum over the hemisphere is a quadrature of its own: 1 % for 400 directions.
            for (size_t c = 1; c <= 4; ++c) {
                EXPECT_LE(reflected[c], albedos[c - 1] * 1.01 + 2 * noise[c]) << lights[l].theta_deg;
                EXPECT_GT(reflected[c], 0.5 * reflected[c - 1]);
            }
            for (size_t c = 1; c < 4; ++c)
                EXPECT_GT(reflected[c + 1] - reflected[c], reflected[c] - reflected[c - 1] - 1e-6);
            EXPECT_NEAR(reflected[4], 1, 0.01 + 2 * noise[4]) << "white furnace, " << lights[l].theta_deg;
        }
    }
}

// The diagonals of the cells do not turn with the relief: it must be smooth enough for them not to matter.
TEST(Invariants, RotationBy90Degrees) {
    const HeightField surface = generate_gaussian(48, 48, 1e-4, 12e-4, 0.6, 7);
    HeightField rotated = surface;  // (x, y) -> (-y, x)
    for (int j = 0; j < 48; ++j)
        for (int i = 0; i < 48; ++i) rotated.heights[j * 48 + i] = surface.at(j, -i);
    const BrdfPlan plan = plan_of(lights, views, many);
    const Table a = measure(surface, gray({0.8}), plan).table;
    const Table b = measure(rotated, gray({0.8}), turned(plan, 1, 90)).table;
    for (size_t k = 0; k < a.f.size(); ++k)
        EXPECT_NEAR(a.f[k], b.f[k], 4 * std::hypot(doubt(a, k), doubt(b, k)) + 0.01 * a.f[k]) << k;
    // By 180 degrees the diagonals are themselves.
    HeightField upside = surface;
    for (int j = 0; j < 48; ++j)
        for (int i = 0; i < 48; ++i) upside.heights[j * 48 + i] = surface.at(-i, -j);
    expect_tables_agree(a, measure(upside, gray({0.8}), turned(plan, 1, 180)).table, 4);
}

// x <-> y is an exact symmetry of the triangulation.
TEST(Invariants, MirrorAboutTheDiagonal) {
    const HeightField surface = generate_gaussian(48, 40, 1e-4, 6e-4, 0.8, 7);
    HeightField mirrored = surface;
    std::swap(mirrored.nx, mirrored.ny);
    for (int j = 0; j < 48; ++j)
        for (int i = 0; i < 40; ++i) mirrored.heights[j * 40 + i] = surface.at(j, i);
    const BrdfPlan plan = plan_of(lights, views, many);
    expect_tables_agree(measure(surface, gray({0.8}), plan).table,
                        measure(mirrored, gray({0.8}), turned(plan, -1, 90)).table, 4);
}

TEST(Invariants, MirrorOfAGroove) {
    const HeightField surface = generate_gaussian(48, 1, 1e-4, 6e-4, 0.8, 7);
    HeightField mirrored = surface;
    for (int i = 0; i < 48; ++i) mirrored.heights[i] = surface.at(-i, 0);
    const BrdfPlan plan = plan_of(lights, views, many);
    expect_tables_agree(measure(surface, gray({0.8}), plan).table,
                        measure(mirrored, gray({0.8}), turned(plan, -1, 180)).table, 4);
}

TEST(Invariants, TranslationAndOffset) {
    const HeightField surface = generate_gaussian(40, 36, 1e-4, 6e-4, 0.8, 7);
    std::vector<double> shifted(40 * 36), raised(40 * 36);
    for (int j = 0; j < 36; ++j)
        for (int i = 0; i < 40; ++i) {
            shifted[j * 40 + i] = surface.at(i - 7, j + 11);
            raised[j * 40 + i] = surface.at(i, j) + 0.5;
        }
    const BrdfPlan plan = plan_of(lights, views, some);
    const Table a = measure(surface, gray({0.8}), plan).table;
    // The same rays from the same places, in another order.
    expect_tables_near(measure(make_height_field(40, 36, 1e-4, 1e-4, shifted), gray({0.8}), plan).table, a,
                       3e-5);
    expect_tables_near(measure(make_height_field(40, 36, 1e-4, 1e-4, raised), gray({0.8}), plan).table, a,
                       3e-5);
}

TEST(Invariants, ScaleOfAllThreeAxes) {
    const HeightField surface = generate_gaussian(40, 36, 1e-4, 6e-4, 0.8, 7);
    const BrdfPlan plan = plan_of(lights, views, some);
    const Table a = measure(surface, gray({0.8}), plan).table;
    for (const double scale : {0x1p-13, 0x1p20}) {
        HeightField scaled = surface;
        scaled.pitch_x *= scale, scaled.pitch_y *= scale;
        for (float& h : scaled.heights) h *= static_cast<float>(scale);
        EXPECT_EQ(measure(scaled, gray({0.8}), plan).table.f, a.f);
    }
}

TEST(Invariants, FlatLimitIsQuadratic) {
    const BrdfPlan plan = in_orders(plan_of({{0, 0}, {30, 40}}, {{20, 100}, {45, 250}}, some), 1);
    std::vector<double> deviation;
    for (const double slope : {0.02, 0.04, 0.08}) {
        const Table table = measure(generate_gaussian(48, 48, 1e-4, 6e-4, slope, 7), gray({1.0}), plan).table;
        double largest = 0;
        for (const float f : table.f) largest = std::max(largest, std::abs(f * pi - 1));
        deviation.push_back(largest);
    }
    EXPECT_NEAR(deviation[1] / deviation[0], 4, 0.2);
    EXPECT_NEAR(deviation[2] / deviation[1], 4, 0.2);
}

// wi = wo: what is lit is what is seen.
TEST(Invariants, RetroDirectionHidesNoShadow) {
    for (const auto& [name, surface] : reliefs()) {
        SCOPED_TRACE(name);
        BrdfPlan plan = plan_of(lights, lights, many);
        plan.max_order = 1;
        const Table table = measure(surface, gray({1.0}), plan).table;
        for (size_t l = 0; l < lights.size(); ++l) {
            // Cauchy and Schwarz: (A cos)^2 = (int V <n,w> dA)^2 <= A_total int V <n,w>^2 dA.
            EXPECT_GT(table.f[l * lights.size() + l] * pi, 0);
            for (size_t o = 0; o < lights.size(); ++o) {
                const double own = table.f[l * lights.size() + l], other = table.f[o * lights.size() + o];
                EXPECT_LE(std::pow(table.f[l * lights.size() + o], 2), own * other * (1 + 1e-5));
            }
        }
    }
}

// Same azimuth over a groove: V_i V_o is the V of the more grazing direction. 45-degree V-groove, walls seen
// down to m = 2 / (1 + tan t), direct f = (1 / pi) <n,wi><n,wo> m / (n_z cos_i cos_o) / 2 a wall.
TEST(Invariants, GrazingDirectionDecidesInOnePlane) {
    BrdfPlan plan = plan_of({{60, 0}, {75, 0}}, {{50, 0}, {70, 0}}, Accuracy::Samples{256, 16, 1, 8});
    plan.max_order = 1;
    const Table table = measure(generate_v_groove(64, 1e-3, 45), gray({1.0}), plan).table;
    for (size_t row = 0; row < 4; ++row) {
        const double ti = std::tan(radians(plan.incident[row / 2].theta_deg)),
                     to = std::tan(radians(plan.outgoing[row % 2].theta_deg));
        const double n = std::sqrt(0.5), seen = 2 / (1 + std::max(ti, to));
        const double exact = n * (1 + ti) * n * (1 + to) * seen / n / 2 / pi;
        EXPECT_NEAR(table.f[row], exact, 4 * doubt(table, row) + 1e-5);
        EXPECT_LT(doubt(table, row), 0.01 * exact);
    }
}

TEST(Invariants, SameBitsForAnyNumberOfThreads) {
    const HeightField surface = generate_gaussian(70, 45, 1e-4, 5e-4, 1, 7);
    for (const bool separate : {false, true}) {
        BrdfPlan plan = plan_for_target(lights, views, 0.005);
        if (separate) plan = in_orders(plan, 3);
        const Table one = measure(surface, gray({0.8}), plan, true, 1).table;
        for (const int threads : {2, 3}) {
            const Table other = measure(surface, gray({0.8}), plan, true, threads).table;
            EXPECT_EQ(one.f, other.f);
            EXPECT_EQ(one.se, other.se);
            EXPECT_EQ(one.bias, other.bias);
        }
    }
}

TEST(Invariants, AnotherSeedIsAnotherMeasurement) {
    BrdfPlan plan = plan_of(lights, views, some);
    const HeightField surface = generate_gaussian(40, 36, 1e-4, 6e-4, 0.8, 7);
    const Table a = measure(surface, gray({0.8}), plan).table;
    EXPECT_EQ(measure(surface, gray({0.8}), plan).table.f, a.f);
    plan.accuracy.seed = 2;
    const Table b = measure(surface, gray({0.8}), plan).table;
    EXPECT_NE(b.f, a.f);
    expect_tables_agree(a, b, 4);
}

// c_k of one run are a run at any albedo; a black channel among them takes nothing from the others. Without
// skips, for whether a second grid is worth its time is another question for each albedo.
TEST(Invariants, ChannelsAreRunsOfTheirOwn) {
    const HeightField surface = generate_gaussian(40, 36, 1e-4, 4e-4, 1.2, 7);
    const BrdfPlan plan = plan_of(lights, views, some);
    for (const std::vector<double>& albedos :
         {std::vector<double>{0.9, 0.5, 0.1}, std::vector<double>{0.0, 0.5, 0.9}}) {
        const Table three = measure(surface, gray(albedos), plan, false).table;
        for (size_t c = 0; c < 3; ++c) {
            const Table one = measure(surface, gray({albedos[c]}), plan, false).table;
            for (size_t row = 0; row < one.rows(); ++row)
                EXPECT_NEAR(three.f[three.index(c, 0, row)], one.f[row], 1e-5 * one.f[row])
                    << "albedo " << albedos[c] << " beside " << albedos[0];
        }
    }
}

TEST(Invariants, OrdersGiveAnyAlbedo) {
    const HeightField surface = generate_gaussian(40, 36, 1e-4, 4e-4, 1.2, 7);
    const Table orders = measure(surface, gray({1.0}), in_orders(plan_of(lights, views, some), 30)).table;
    const Table direct = measure(surface, gray({0.6}), in_orders(plan_of(lights, views, some), 30)).table;
    for (size_t row = 0; row < orders.rows(); ++row) {
        double sum = 0;
        for (size_t k = 1; k <= 30; ++k)
            sum += orders.f[orders.index(0, k, row)] * std::pow(0.6, static_cast<double>(k));
        EXPECT_NEAR(direct.f[row], sum, 1e-5 * sum + 0.05 * direct.bias[row]);
    }
}

TEST(Invariants, ConstantMapIsAConstantAlbedo) {
    const HeightField surface = generate_gaussian(40, 36, 1e-4, 5e-4, 1, 7);
    const Material material({"y"}, Lambertian{Parameter::mapped(40, 36, std::vector<float>(40 * 36, 0.6f))});
    const Table a = measure(surface, material, plan_of(lights, views, some)).table;
    const Table b = measure(surface, gray({0.6}), plan_of(lights, views, some)).table;
    for (size_t row = 0; row < a.rows(); ++row)
        EXPECT_NEAR(a.f[row], b.f[row], 3e-5 * b.f[row] + 0.05 * b.bias[row]);
}

}  // namespace
}  // namespace gonio
