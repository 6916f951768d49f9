// Light fields under an environment: the radiances that relight finds, and what the path tracer sees.
#include "agreement/measured.h"
#include "agreement/traced_sky.h"
#include "base/error.h"
#include "base/half.h"
#include "measure/glossy_btf.h"
#include "measure/relight.h"
#include "surface/generate.h"

namespace gonio {
namespace {

const std::vector<AnglesDeg> views = {{0, 0}, {45, 30}, {65, 200}};

HeightField field() {
    return generate_gaussian(48, 48, 1, 6, 0.8, 4);
}

BtfPlan plan_of_views(int replicates) {
    BtfPlan plan;
    plan.outgoing = views;
    plan.pixel_samples = 8;
    plan.accuracy.samples = Accuracy::Samples{1, 128, 1, replicates};
    return plan;
}

Environment in_colour(const Environment& grey) {
    Environment sky = grey;
    sky.n_channels = 3;
    for (const float factor : {3.0f, 0.25f})
        for (size_t k = 0; k < grey.radiance.size(); ++k)
            sky.radiance.push_back(factor * grey.radiance[(k * 7) % grey.radiance.size()]);
    return sky;
}

Btf measured(const HeightField& surface, const Material& material, const BtfPlan& plan,
             const Environment& sky) {
    return measure_btf(surface, material, plan, {}, {}, &sky).btf;
}

TEST(LightFieldUnderASky, HasTheRadianceThatRelightFinds) {
    const Environment sky = in_colour(test::uneven_sky());
    const Material material = gray({0.8, 0.5, 0.3});
    BtfPlan plan = plan_of_views(2);
    plan.accuracy.samples->sub_samples = 2;
    const Btf btf = measured(field(), material, plan, sky);
    RelightPlan same;
    same.outgoing = views;
    same.accuracy = plan.accuracy;
    const Relit relit = measure_relight(field(), material, sky, same, {}).relit;
    ASSERT_EQ(btf.radiance.size(), relit.radiance.size());
    for (size_t c = 0; c < 3; ++c) {
        const double irradiance = horizontal_irradiance(sky, static_cast<int>(c));
        for (size_t facet = 0; facet < relit.n_facets; ++facet) {
            const double expected = relit.radiance[c * relit.n_facets + facet] / irradiance;
            ASSERT_NEAR(from_half_bits(btf.radiance[c * relit.n_facets + facet]), expected,
                        2e-3 * expected + 1e-6)
                << c << " " << facet;
        }
        EXPECT_NEAR(btf.pixel_se[c], relit.radiance_se[c] / irradiance, 0.01 * btf.pixel_se[c]);
    }
}

TEST(LightFieldUnderASky, AgreesWithThePathTracer) {
    const Environment sky = test::uneven_sky();
    const double irradiance = horizontal_irradiance(sky, 0);
    const Btf btf = measured(field(), gray({0.8}), plan_of_views(8), sky);
    PathTracerOptions options;
    options.paths = 70000;
    for (size_t v = 0; v < views.size(); ++v) {
        const test::Traced traced = test::trace(field(), gray({0.8}), sky, to_vector(views[v]), options);
        const double sigma = std::hypot(btf.mean.se[v], btf.mean.bias[v], traced.se / irradiance);
        EXPECT_NEAR(btf.mean.f[v], traced.radiance / irradiance, 3 * sigma) << v;
        EXPECT_LT(sigma, 0.02 * btf.mean.f[v]);
    }
}

// So far away that all pixels are seen from one direction: one from each camera.
TEST(LightFieldUnderASky, OfFarCamerasIsThatOfDirections) {
    const HeightField surface = field();
    BtfPlan plan = plan_of_views(2);
    const double far = 1e5 * surface.width();
    plan.cameras = CameraPlane{3, 1, 3 * far, far, far};
    plan.outgoing.clear();
    const Btf cameras = measured(surface, gray({0.8}), plan, test::uneven_sky());
    plan.cameras.reset();
    plan.outgoing = {{45, 180}, {0, 0}, {45, 0}};
    const Btf directions = measured(surface, gray({0.8}), plan, test::uneven_sky());
    EXPECT_EQ(cameras.radiance, directions.radiance);
    for (size_t v = 0; v < 3; ++v)
        EXPECT_NEAR(cameras.mean.f[v], directions.mean.f[v], 2e-3 * directions.mean.f[v]) << v;
}

// Under a dark channel there is nothing to see, and no division by its irradiance either.
TEST(LightFieldUnderASky, ADarkChannelIsBlack) {
    const Btf btf =
        measured(field(), gray({0.8, 0.8, 0.8}), plan_of_views(2), uniform_environment({1, 0, 1}));
    for (const float f : btf.mean.f) EXPECT_TRUE(std::isfinite(f));
    const size_t n = btf.shape.n_facets;
    for (size_t facet = 0; facet < n; ++facet) ASSERT_EQ(btf.radiance[n + facet], 0);
    EXPECT_GT(btf.mean.f[0], 0.2);
}

// ---- glossy facets ----

Material ggx(double alpha, double reflectance = 0.9) {
    Microfacet lobe;
    lobe.alpha_x = lobe.alpha_y = alpha;
    lobe.reflectance.reflectance = reflectance;
    return {{"y"}, lobe};
}
struct Pictures {
    Btf btf;
    Report report;
    std::vector<std::vector<float>> images;  // [view], [channel][pixel]
};
Pictures glossy(const HeightField& surface, const Material& material, const BtfPlan& plan,
                const Environment& sky, const RunOptions& options = {}) {
    const Monitor monitor;
    GlossyBtf measured(surface, material, plan, options, monitor, &sky);
    Pictures pictures;
    pictures.btf = measured.pictures([&](int, std::span<const uint16_t> images) {
        auto& values = pictures.images.emplace_back();
        for (const uint16_t half : images) values.push_back(from_half_bits(half));
    });
    pictures.report = measured.report();
    return pictures;
}

// The same light, made for relight facet by facet: by one seed the same to rounding.
TEST(GlossyLightFieldUnderASky, ShowsTheRadianceThatRelightFinds) {
    const Environment sky = in_colour(test::uneven_sky());
    const Material material{{"r", "g", "b"}, ggx(0.3).lobes[0].lobe};
    BtfPlan plan = plan_of_views(2);
    plan.pixel_samples = 1;
    const Pictures pictures = glossy(field(), material, plan, sky);
    RelightPlan same;
    same.outgoing = views;
    same.accuracy = plan.accuracy;
    const Relit relit = measure_relight(field(), material, sky, same, {}).relit;
    const size_t n = 48 * 48;
    for (size_t v = 0; v < views.size(); ++v)
        for (size_t c = 0; c < 3; ++c) {
            const double irradiance = horizontal_irradiance(sky, static_cast<int>(c));
            for (size_t p = 0; p < n; ++p) {
                const double expected = relit.images[(v * 3 + c) * n + p] / irradiance;
                ASSERT_NEAR(pictures.images[v][c * n + p], expected, 3e-3 * expected + 1e-6) << v << " " << c;
            }
        }
}

TEST(GlossyLightFieldUnderASky, AgreesWithThePathTracer) {
    const Environment sky = test::uneven_sky();
    const double irradiance = horizontal_irradiance(sky, 0);
    const Btf btf = glossy(field(), ggx(0.3), plan_of_views(8), sky).btf;
    PathTracerOptions options;
    options.paths = 20000;
    for (size_t v = 0; v < views.size(); ++v) {
        const test::Traced traced = test::trace(field(), ggx(0.3), sky, to_vector(views[v]), options);
        const double sigma = std::hypot(btf.mean.se[v], btf.mean.bias[v], traced.se / irradiance);
        EXPECT_NEAR(btf.mean.f[v], traced.radiance / irradiance, 3 * sigma) << v;
        EXPECT_LT(sigma, 0.03 * btf.mean.f[v]);
    }
}

// How far few runs are from many is what they say of one pixel.
TEST(GlossyLightFieldUnderASky, StatesTheErrorOfAPixel) {
    BtfPlan plan = plan_of_views(4);
    plan.pixel_samples = 1;
    const Pictures few = glossy(field(), ggx(0.3), plan, test::uneven_sky());
    plan.accuracy.samples->replicates = 32;
    plan.accuracy.seed = 2;
    const Pictures many = glossy(field(), ggx(0.3), plan, test::uneven_sky());
    double squares = 0;
    const size_t n = few.btf.shape.n_pixels();
    for (size_t v = 0; v < views.size(); ++v)
        for (size_t p = 0; p < n; ++p)
            squares +=
                std::pow(few.images[v][p] - many.images[v][p], 2) / static_cast<double>(views.size() * n);
    const double stated = std::hypot(few.btf.pixel_se[0], many.btf.pixel_se[0]);
    EXPECT_NEAR(std::sqrt(squares), stated, 0.2 * stated);
}

// Each pixel of a plane is seen from its own direction: mirrored in it under a sky of two halves, the one is
// brighter.
TEST(GlossyLightFieldUnderASky, LooksToEveryPixelFromTheCamera) {
    Environment halves;
    halves.nx = 64, halves.ny = 32, halves.n_channels = 1;
    for (int k = 0; k < 64 * 32; ++k) halves.radiance.push_back(k % 64 >= 16 && k % 64 < 48 ? 4.0f : 1.0f);
    BtfPlan plan = plan_of_views(4);
    plan.pixel_samples = 1;
    plan.outgoing.clear();
    plan.cameras = CameraPlane{1, 1, 8, 8, 4};
    plan.pixels_x = 8, plan.pixels_y = 1;
    const Pictures pictures = glossy(generate_plane(8, 1), ggx(0.15), plan, halves);
    // Bright towards +x, which pixels to the right of the camera mirror away from it.
    for (int i = 0; i + 1 < 8; ++i) EXPECT_GT(pictures.images[0][i + 1], 0.99 * pictures.images[0][i]) << i;
    EXPECT_GT(pictures.images[0][7], 2 * pictures.images[0][0]);
}

TEST(GlossyLightFieldUnderASky, SameBitsForAnyNumberOfThreads) {
    BtfPlan plan = plan_of_views(2);
    plan.pixel_samples = 2;
    const Pictures a = glossy(field(), ggx(0.3), plan, test::uneven_sky()),
                   b = glossy(field(), ggx(0.3), plan, test::uneven_sky(), {.n_threads = 4});
    EXPECT_EQ(a.images, b.images);
    EXPECT_EQ(a.btf.mean.f, b.btf.mean.f);
    EXPECT_EQ(a.btf.pixel_se, b.btf.pixel_se);
}

double counter(const Report& report, const std::string& name) {
    for (const auto& [key, value] : report.counters)
        if (key == name) return value;
    return -1;
}

// With memory for all views, for three and for one: as many runs, of the same pictures.
TEST(GlossyLightFieldUnderASky, SameBitsInAnyNumberOfBlocks) {
    const HeightField surface = generate_gaussian(32, 32, 1, 6, 0.8, 4);
    const Material material{{"r", "g", "b"}, ggx(0.3).lobes[0].lobe};
    const Environment sky = in_colour(test::uneven_sky());
    BtfPlan plan;
    plan.pixel_samples = 3;
    plan.azimuths = 8;
    plan.accuracy.target_relative_error = 0.04;
    for (int k = 0; k < 7; ++k) plan.outgoing.push_back({10.0 * k, 50.0 * k});
    const double bytes = predict_btf(surface, material, plan).memory_bytes - (64 << 20);
    BtfPlan with_another = plan;
    with_another.outgoing.push_back({70, 0});
    const double view = predict_btf(surface, material, with_another).memory_bytes - (64 << 20) - bytes;
    const auto in_memory_for = [&](double n_views) {
        RunOptions options;
        options.max_bytes = std::llround(bytes - (7 - n_views) * view);
        return glossy(surface, material, plan, sky, options);
    };
    const Pictures whole = glossy(surface, material, plan, sky);
    EXPECT_EQ(counter(whole.report, "view_blocks"), 1);
    EXPECT_GT(whole.report.relative_error, 0);
    for (const int together : {3, 1}) {
        const Pictures cut = in_memory_for(together + 0.5);
        EXPECT_EQ(counter(cut.report, "view_blocks"), together == 3 ? 3 : 7);
        EXPECT_EQ(cut.images, whole.images);
        EXPECT_EQ(cut.btf.mean.f, whole.btf.mean.f);
        EXPECT_EQ(cut.btf.mean.se, whole.btf.mean.se);
        EXPECT_EQ(cut.btf.mean.bias, whole.btf.mean.bias);
        EXPECT_EQ(cut.btf.pixel_se, whole.btf.pixel_se);
        EXPECT_EQ(cut.report.settings, whole.report.settings);
        EXPECT_EQ(cut.report.relative_error, whole.report.relative_error);
    }
    EXPECT_THROW(in_memory_for(0.9), Error);
}

}  // namespace
}  // namespace gonio
