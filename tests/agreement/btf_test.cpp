// BTFs against closed forms, and their means against the BRDF of the same relief.
#include "measure/btf.h"

#include "agreement/measured.h"
#include "base/half.h"
#include "directions/gonio_grid.h"
#include "measure/mesh_bias.h"
#include "surface/generate.h"

namespace gonio {
namespace {

BtfPlan btf_plan(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing,
                 Accuracy::Samples samples = {1, 64, 1, 4}) {
    BtfPlan plan;
    plan.incident = std::move(incident);
    plan.outgoing = std::move(outgoing);
    plan.accuracy.samples = samples;
    return plan;
}

std::vector<float> image(const Btf& btf, int view, int light, int channel = 0) {
    std::vector<uint16_t> images(btf.shape.images_size() / btf.shape.n_views);
    expand_view(btf.shape, btf.radiance, btf.view_maps, view, images);
    std::vector<float> values;
    for (size_t p = 0; p < btf.shape.n_pixels(); ++p)
        values.push_back(from_half_bits(
            images[(static_cast<size_t>(light) * btf.shape.n_channels + channel) * btf.shape.n_pixels() +
                   p]));
    return values;
}

double mean_of(const std::vector<float>& values) {
    double sum = 0;
    for (const float v : values) sum += v;
    return sum / static_cast<double>(values.size());
}

HeightField field(double slope = 0.7) {
    return generate_gaussian(64, 64, 1, 8, slope, 11);
}
const std::vector<AnglesDeg> lights = {{0, 0}, {30, 40}, {60, 200}}, views = {{0, 0}, {45, 10}, {65, 130}};

TEST(Btf, OfAPlaneIsAlbedoOverPi) {
    const BtfResult result =
        measure_btf(generate_plane(4, 1), gray({0.5, 0.25}), btf_plan(lights, views), {});
    for (size_t v = 0; v < views.size(); ++v)
        for (size_t l = 0; l < lights.size(); ++l)
            for (int c = 0; c < 2; ++c)
                for (const float value : image(result.btf, static_cast<int>(v), static_cast<int>(l), c))
                    EXPECT_NEAR(value, (c == 0 ? 0.5 : 0.25) / pi, 5e-4 * 0.5 / pi);
    EXPECT_EQ(result.report.relative_error, 0);
}

// One facing wall of a V-groove, lit and seen head on: L = albedo / pi * cos(0), over the base plane's cos_i.
TEST(Btf, OfAVGrooveIsTheRadianceOfItsWalls) {
    BtfPlan plan = btf_plan({{45, 0}}, {{45, 0}, {0, 0}});
    plan.max_order = 1;
    const BtfResult result = measure_btf(generate_v_groove(64, 1, 45), gray({0.8}), plan, {});
    const double wall = 0.8 / pi / std::cos(radians(45));
    for (const float value : image(result.btf, 0, 0)) EXPECT_NEAR(value, wall, 1e-3 * wall);
    int lit = 0;
    for (const float value : image(result.btf, 1, 0)) {
        EXPECT_TRUE(value == 0 || std::abs(value - wall) < 1e-3 * wall) << value;
        lit += value > 0;
    }
    EXPECT_EQ(lit, 32);  // from above, half of the pixels show the walls that face the light
}

// Two measurements that share nothing but the relief: the BRDF by products of irradiances, the BTF by pixels.
void expect_brdf_as_mean(double slope, const BtfPlan& plan) {
    const Btf btf = measure_btf(field(slope), gray({0.8}), plan, {}).btf;
    const Table brdf = measure(field(slope), gray({0.8}), plan_for_target(lights, views, 0.002)).table;
    double deviation = 0;
    for (size_t k = 0; k < brdf.f.size(); ++k) {
        const double sigma = (btf.mean.f[k] - brdf.f[k]) / std::hypot(doubt(btf.mean, k), doubt(brdf, k));
        EXPECT_LE(std::abs(sigma), 3.5) << "slope " << slope << " row " << k;
        EXPECT_LE(doubt(btf.mean, k), 0.02 * brdf.f[k]) << "an error bar that says nothing";
        deviation += sigma * sigma / static_cast<double>(brdf.f.size());
    }
    EXPECT_LE(deviation, 1.9) << "slope " << slope;  // chi-square of nine, 95 %
}

TEST(Btf, HasTheBrdfAsItsMean) {
    for (const double slope : {0.3, 0.7, 1.2}) {
        BtfPlan plan = btf_plan(lights, views);
        plan.accuracy.samples.reset();  // whatever a job gets that asks for nothing
        expect_brdf_as_mean(slope, plan);
        plan.pixels_x = plan.pixels_y = 128;
        plan.pixel_samples = 2;
        plan.accuracy.samples = Accuracy::Samples{2, 64, 2, 6};
        expect_brdf_as_mean(slope, plan);
    }
}

// Few directions, many runs: an operator that met its own noise would make all orders 0.7 % too bright.
TEST(Btf, HasNoBiasFromFewDirections) {
    BtfPlan plan = btf_plan(lights, views, {1, 8, 1, 96});
    plan.pixels_x = plan.pixels_y = 96;
    plan.pixel_samples = 2;
    const Btf btf = measure_btf(field(), gray({0.8}), plan, {}).btf;
    const Table brdf = measure(field(), gray({0.8}), plan_for_target(lights, views, 0.001)).table;
    double mean = 0;
    for (size_t k = 0; k < brdf.f.size(); ++k) mean += btf.mean.f[k] / brdf.f[k] - 1;
    mean /= static_cast<double>(brdf.f.size());
    EXPECT_NEAR(mean, 0, 0.002);  // 3 sigma
}

TEST(Btf, StatesTheMeanOfItsImages) {
    for (const int samples : {1, 3}) {
        BtfPlan plan = btf_plan(lights, views);
        plan.pixel_samples = samples;
        plan.pixels_x = 48, plan.pixels_y = 32;
        const Btf btf = measure_btf(field(), gray({0.8, 0.3}), plan, {}).btf;
        for (size_t c = 0; c < 2; ++c)
            for (size_t l = 0; l < lights.size(); ++l)
                for (size_t v = 0; v < views.size(); ++v) {
                    const double stated = btf.mean.f[btf.mean.index(c, 0, l * views.size() + v)];
                    EXPECT_NEAR(
                        mean_of(image(btf, static_cast<int>(v), static_cast<int>(l), static_cast<int>(c))),
                        stated, 2e-4 * stated);
                }
    }
}

// What all runs have in common no run shows: the triangles of a relief two cells fine.
TEST(Btf, DoubtsTheMeshOfACoarseRelief) {
    const HeightField coarse = generate_gaussian(64, 64, 1, 2, 0.7, 11);
    const double guess = predict_mesh_bias(coarse).guess;
    ASSERT_GT(guess, 0.005);
    const Table mean = measure_btf(coarse, gray({0.8}), btf_plan(lights, views), {}).btf.mean;
    for (size_t k = 0; k < mean.f.size(); ++k) EXPECT_GE(mean.bias[k], 0.99 * guess * mean.f[k]) << k;
}

TEST(Btf, HasOrdersThatAddUp) {
    BtfPlan plan = btf_plan(lights, views);
    plan.max_order = 1;
    const Btf first = measure_btf(field(), gray({0.8}), plan, {}).btf;
    plan.max_order = 3;
    const Btf three = measure_btf(field(), gray({0.8}), plan, {}).btf;
    plan.max_order = 0;
    const Btf all = measure_btf(field(), gray({0.8}), plan, {}).btf;
    BrdfPlan brdf = plan_for_target(lights, views, 0.003);
    brdf.separate_orders = true;
    const Table orders = measure(field(), gray({0.8}), brdf).table;
    for (size_t r = 0; r < orders.rows(); ++r) {
        const double second = orders.f[orders.index(0, 2, r)], third = orders.f[orders.index(0, 3, r)];
        EXPECT_NEAR(three.mean.f[r] - first.mean.f[r], second + third, 0.1 * (second + third)) << r;
        EXPECT_GT(all.mean.f[r], three.mean.f[r]);
    }
}

// A map of two albedos: what a pixel shows has the albedo of its own facet, and light from the others.
TEST(Btf, FollowsAnAlbedoMap) {
    const HeightField plane = generate_plane(32, 1);
    HeightField square = plane;
    square.ny = 32;
    square.heights.assign(32 * 32, 0.0f);
    std::vector<float> albedo;
    for (int k = 0; k < 32 * 32; ++k) albedo.push_back(k % 32 < 16 ? 0.2f : 0.9f);
    const Material material{{"y"}, Lambertian{Parameter::mapped(32, 32, albedo)}};
    const Btf btf = measure_btf(square, material, btf_plan({{20, 0}}, {{50, 77}}), {}).btf;
    const std::vector<float> values = image(btf, 0, 0);
    for (int k = 0; k < 32 * 32; ++k) EXPECT_NEAR(values[k], (k % 32 < 16 ? 0.2 : 0.9) / pi, 1e-3);
}

TEST(Btf, HasTheSameBitsOnAnyNumberOfThreads) {
    BtfPlan plan = btf_plan(equal_projected_hemisphere(40), views);
    RunOptions one, three;
    three.n_threads = 3;
    const Btf a = measure_btf(field(), gray({0.8}), plan, one).btf,
              b = measure_btf(field(), gray({0.8}), plan, three).btf;
    EXPECT_EQ(a.radiance, b.radiance);
    EXPECT_EQ(a.view_maps, b.view_maps);
    EXPECT_EQ(a.mean.f, b.mean.f);
    EXPECT_EQ(a.mean.se, b.mean.se);
    EXPECT_EQ(a.pixel_se, b.pixel_se);
}

// The error of a pixel: two measurements of other seeds differ by sqrt(2) of it, rms over the relief.
TEST(Btf, StatesTheErrorOfAPixel) {
    BtfPlan plan = btf_plan(lights, views, {1, 32, 1, 6});
    const Btf a = measure_btf(field(), gray({0.8}), plan, {}).btf;
    plan.accuracy.seed = 2;
    const Btf b = measure_btf(field(), gray({0.8}), plan, {}).btf;
    const size_t n = a.shape.n_facets;
    for (size_t l = 0; l < lights.size(); ++l) {
        double squares = 0;
        for (size_t f = 0; f < n; ++f)
            squares +=
                std::pow(from_half_bits(a.radiance[l * n + f]) - from_half_bits(b.radiance[l * n + f]), 2);
        const double rms = std::sqrt(squares / static_cast<double>(2 * n)),
                     stated = std::hypot(a.pixel_se[l], b.pixel_se[l]) / std::sqrt(2);
        EXPECT_NEAR(rms, stated, 0.2 * stated) << l;
    }
}

TEST(Btf, EndsWhereItCannotFitOrIsCancelled) {
    RunOptions small;
    small.max_bytes = 1 << 20;
    try {
        measure_btf(field(), gray({0.8}), btf_plan(lights, views), small);
        ADD_FAILURE() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::limit);
    }
    const std::atomic<bool> cancelled{true};
    Monitor monitor;
    monitor.cancel_requested = &cancelled;
    try {
        measure_btf(field(), gray({0.8}), btf_plan(lights, views), {}, monitor);
        ADD_FAILURE() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::cancelled);
    }
}

}  // namespace
}  // namespace gonio
