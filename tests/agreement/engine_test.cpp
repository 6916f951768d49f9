// The fast engine against the path tracer: two techniques that share nothing but the relief, on every kind of
// relief and of table.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "agreement/measured.h"
#include "directions/gonio_grid.h"
#include "measure/reference.h"
#include "surface/generate.h"
#include "surface/prepare.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

// Many views with few paths each: all lights of a view share its paths, so their errors are nearly one.
constexpr long long paths = 5000;

// Differences over their stated errors; and of each view the mean difference, relative to the whole table's
// mean.
struct Agreement {
    std::vector<double> pulls, of_view;
};

Agreement compare(const HeightField& surface, const Material& material, const BrdfPlan& plan) {
    const Table fast = measure(surface, material, plan).table;
    BrdfPlan other = plan;
    other.accuracy.seed = plan.accuracy.seed + 1000;
    const Table traced = measure_reference(surface, material, other, {paths}, {}).table;
    Agreement result;
    std::vector<double> sum(plan.outgoing.size(), 0.0), rows(plan.outgoing.size(), 0.0);
    double mean = 0;
    for (size_t c = 0; c < traced.channels.size(); ++c)
        for (size_t slice = 0; slice < traced.slices(); ++slice)
            for (size_t row = 0; row < traced.rows(); ++row) {
                const size_t k = traced.index(c, slice, row);
                const double off = fast.f[k] - traced.f[k];
                mean += traced.f[k] / static_cast<double>(traced.f.size());
                sum[traced.pair(row).second] += off;
                rows[traced.pair(row).second] += 1;
                // What no path and no shift changes has no spread but rounding to float; and where all the
                // paths missed a light, the path tracer knows neither the value nor its error.
                const bool exact = std::abs(off) < 3e-6 * std::max(1.0f, fast.f[k]);
                result.pulls.push_back(
                    exact || traced.se[k] == 0 ? 0 : off / std::hypot(doubt(fast, k), traced.se[k]));
            }
    for (size_t o = 0; o < sum.size(); ++o)
        if (rows[o] > 0) result.of_view.push_back(sum[o] / rows[o] / mean);
    return result;
}

void expect_agree(const std::string& what, const HeightField& surface, const Material& material,
                  const BrdfPlan& plan) {
    const Agreement result = compare(surface, material, plan);
    const double bound = reference::sidak_sigmas(result.pulls.size());
    for (size_t k = 0; k < result.pulls.size(); ++k)
        EXPECT_LT(std::abs(result.pulls[k]), bound) << what << ", value " << k;
    // Lights of one view have errors in common: the rms is that of the number of views.
    const double n_views = static_cast<double>(result.of_view.size());
    EXPECT_LT(reference::rms(result.pulls), 1 + 3 / std::sqrt(2 * n_views)) << what;
    if (n_views < 10) return;
    // A shift of the whole table shows long before single values do: its error is that of independent views.
    double mean = 0, spread = 0;
    for (const double v : result.of_view) mean += v / n_views;
    for (const double v : result.of_view) spread += (v - mean) * (v - mean) / (n_views - 1);
    EXPECT_LT(std::abs(mean), 4 * std::sqrt(spread / n_views) + plan.accuracy.target_relative_error.value())
        << what << ", mean over the table";
}

std::vector<AnglesDeg> lights() {
    return {{0, 0}, {30, 70}, {60, 200}, {75, 320}};
}
std::vector<AnglesDeg> views() {
    return product_grid({10, 35, 60, 75}, {15, 75, 135, 195, 255, 315});
}

TEST(FastEngineAgrees, GaussianFields) {
    for (const double correlation_length : {8.0, 2.0})
        for (const double slope : {0.3, 0.7, 1.5})
            expect_agree("slope " + std::to_string(slope) + ", length " + std::to_string(correlation_length),
                         generate_gaussian(128, 128, 1, correlation_length, slope, 5), gray({0.8}),
                         plan_for_target(lights(), views(), 0.004));
}

TEST(FastEngineAgrees, WhiteNoise) {
    std::mt19937_64 random(3);
    std::vector<double> heights(64 * 64);
    for (double& h : heights) h = std::uniform_real_distribution<double>(0, 1.5)(random);
    expect_agree("white noise", make_height_field(64, 64, 1, 1, heights), gray({0.8}),
                 plan_for_target(lights(), views(), 0.004));
}

TEST(FastEngineAgrees, SphericalPits) {
    for (const double eta_deg : {60.0, 90.0})
        expect_agree("pits of " + std::to_string(eta_deg), generate_spherical_pits(64, 2.5, 1, eta_deg),
                     gray({0.9}), plan_for_target(lights(), views(), 0.004));
}

TEST(FastEngineAgrees, PitchThatIsNotSquare) {
    HeightField field = generate_gaussian(128, 64, 1, 6, 0.7, 8);
    field.pitch_y = 2.5;
    expect_agree("pitch 1 x 2.5", field, gray({0.8}), plan_for_target(lights(), views(), 0.004));
    std::swap(field.pitch_x, field.pitch_y);
    expect_agree("pitch 2.5 x 1", field, gray({0.8}), plan_for_target(lights(), views(), 0.004));
}

TEST(FastEngineAgrees, AlbedoMaps) {
    const HeightField field = generate_gaussian(96, 96, 1, 6, 1.0, 9);
    Parameter map;
    map.map_nx = map.map_ny = 96;
    // Three channels: bright valleys, stripes across x, and noise.
    std::mt19937_64 random(4);
    map.map.resize(3 * field.heights.size());
    for (size_t k = 0; k < field.heights.size(); ++k) {
        map.map[k] = field.heights[k] < 0 ? 0.9f : 0.2f;
        map.map[field.heights.size() + k] = k % 96 / 8 % 2 ? 1.0f : 0.0f;
        map.map[2 * field.heights.size() + k] = std::uniform_real_distribution<float>(0, 1)(random);
    }
    expect_agree("map of 3 channels", field, {{"valleys", "stripes", "noise"}, Lambertian{map}},
                 plan_for_target(lights(), views(), 0.005));
}

TEST(FastEngineAgrees, Colours) {
    expect_agree("RGB", generate_gaussian(96, 96, 1, 6, 1.0, 10), gray({0.9, 0.5, 0.1}),
                 plan_for_target(lights(), views(), 0.004));
}

TEST(FastEngineAgrees, Tables) {
    const HeightField field = generate_gaussian(128, 128, 1, 8, 0.7, 11);
    expect_agree("one light", field, gray({0.8}),
                 plan_for_target({{55, 30}}, equal_projected_hemisphere(100), 0.005));
    expect_agree("one view", field, gray({0.8}),
                 plan_for_target(equal_projected_hemisphere(100), {{55, 30}}, 0.005));
    BrdfPlan sets = plan_for_target(views(), views(), 0.004);
    expect_agree("the same set twice", field, gray({0.8}), sets);
    // Every light with a few views of its own, and a pair twice.
    BrdfPlan list = plan_for_target(equal_projected_hemisphere(40), equal_projected_hemisphere(50), 0.005);
    for (int i = 0; i < 40; ++i)
        for (const int o : {i, (7 * i + 3) % 50, (11 * i + 29) % 50}) list.pairs.emplace_back(i, o);
    list.pairs.push_back(list.pairs.front());
    expect_agree("list of pairs", field, gray({0.8}), list);
}

TEST(FastEngineAgrees, FirstOrders) {
    const HeightField field = generate_gaussian(96, 96, 1, 8, 1.2, 12);
    BrdfPlan plan = plan_for_target(lights(), views(), 0.005);
    plan.max_order = 3;
    expect_agree("orders 1 to 3", field, gray({1}), plan);
    plan.separate_orders = true;
    expect_agree("orders 1 to 3 apart", field, gray({1}), plan);
}

PreparedSurface sample(const char* file, const PrepareOptions& options) {
    return prepare_surface(read_heights(std::string(GONIO_TEST_DATA "/samples/") + file), options);
}

TEST(FastEngineAgrees, RealSamples) {
    PrepareOptions lava;
    lava.width = 50e-3;
    lava.height_range = 5e-3;
    PrepareOptions wool;
    wool.width = 40e-3;
    wool.height_range = 0.95e-3;
    PrepareOptions tiles;
    tiles.width = 1;
    tiles.height_range = 10e-3;
    PrepareOptions levelled;
    levelled.level = Level::plane;
    levelled.boundary = Boundary::mirror;
    levelled.crop = {32, 16, 96, 64};
    PrepareOptions open;
    open.level = Level::plane;
    open.boundary = Boundary::open;
    const std::pair<const char*, PrepareOptions> samples[] = {{"lava_rock_256_16bit.png", lava},
                                                              {"wool_256_8bit.png", wool},
                                                              {"tiles_256_8bit.png", tiles},
                                                              {"afm_rough.gsf", levelled},
                                                              {"afm_rough.gsf", open},
                                                              {"machined_grooves_256.gsf", levelled},
                                                              {"machined_grooves_256.gsf", open},
                                                              {"fuji_256.gsf", levelled},
                                                              {"fuji_256.gsf", open}};
    for (const auto& [file, options] : samples)
        expect_agree(std::string(file) + (options.boundary == Boundary::open ? ", open" : ""),
                     sample(file, options).surface, gray({0.8}), plan_for_target(lights(), views(), 0.004));
}

TEST(FastEngineAgrees, OpenBorderOfASteepField) {
    HeightField field = generate_gaussian(128, 128, 1, 6, 1.0, 13);
    field.border_x = 24;
    field.border_y = 40;
    expect_agree("open border", field, gray({0.8}), plan_for_target(lights(), views(), 0.004));
}

}  // namespace
}  // namespace gonio
