// Reliefs under environments: the furnace, the plane, and a sun that must be what a BRDF says of its
// direction.
#include "measure/relight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "agreement/traced_sky.h"
#include "base/error.h"
#include "measure/brdf.h"
#include "surface/generate.h"

namespace gonio {
namespace {

Material lambertian(double albedo) {
    return {{"y"}, Lambertian{albedo}};
}

RelightPlan plan_of(int replicates) {
    RelightPlan plan;
    plan.outgoing = {{0, 0}, {45, 30}, {70, 200}};
    plan.accuracy.samples = Accuracy::Samples{1, 128, 1, replicates};
    return plan;
}

// Under a uniform sky of 1 a white relief is as bright as the sky, everywhere and from everywhere.
TEST(Relight, Furnace) {
    for (const double slope : {0.4, 1.0}) {
        const HeightField surface = generate_gaussian(64, 64, 1, 6, slope, 3);
        const RelightResult result =
            measure_relight(surface, lambertian(1), uniform_environment({1}), plan_of(8), {});
        const Relit& relit = result.relit;
        for (size_t v = 0; v < 3; ++v) {
            EXPECT_NEAR(relit.mean[v], 1, 3.5 * relit.se[v] + relit.bias[v]) << slope << " " << v;
            EXPECT_LT(relit.se[v], 0.004);
            EXPECT_LT(relit.bias[v], 0.03);
        }
        // Of single facets the random runs know the error, too: three quarters within twice of it.
        size_t near = 0;
        double mean = 0, squares = 0;
        for (const float radiance : relit.radiance) {
            squares += std::pow(radiance - 1, 2) / static_cast<double>(relit.radiance.size());
            near += std::abs(radiance - 1) < 2 * relit.radiance_se[0];
            mean += radiance / static_cast<double>(relit.radiance.size());
        }
        EXPECT_GT(near, relit.radiance.size() * 3 / 4) << slope;
        EXPECT_NEAR(mean, 1, 0.003);
        EXPECT_LT(relit.radiance_se[0], 1.5 * std::sqrt(squares));
    }
}

TEST(Relight, APlaneReflectsItsIrradiance) {
    RelightPlan plan = plan_of(2);
    plan.pixels_x = 5, plan.pixels_y = 3;
    const RelightResult result =
        measure_relight(generate_plane(32, 1), Material{{"r", "g", "b"}, Lambertian{{0.5, 0.2, 1}}},
                        uniform_environment({3}), plan, {});
    ASSERT_EQ(result.relit.images.size(), 3u * 3 * 5 * 3);
    for (int c = 0; c < 3; ++c)
        for (int v = 0; v < 3; ++v) {
            const double expected = 3 * std::vector{0.5, 0.2, 1.0}[c];
            EXPECT_NEAR(result.relit.mean[c * 3 + v], expected, 1e-4);
            EXPECT_NEAR(result.relit.images[(static_cast<size_t>(v) * 3 + c) * 15 + 7], expected, 1e-4);
        }
}

// Each run turns its azimuths: under a sky that few of them can tell, they leave an error that the runs know
// of and that their mean has not.
TEST(Relight, FewAzimuthsAreNoBias) {
    const HeightField groove = generate_v_groove(32, 32, 50);
    const Environment sky = uniform_environment({1});
    RelightPlan plan = plan_of(64);
    plan.azimuths = 3;
    const Relit few = measure_relight(groove, lambertian(0.8), sky, plan, {}).relit;
    plan.accuracy.samples->replicates = 8;
    plan.azimuths = 64;
    const Relit many = measure_relight(groove, lambertian(0.8), sky, plan, {}).relit;
    for (int v = 0; v < 3; ++v) {
        EXPECT_NEAR(few.mean[v], many.mean[v], 3.5 * std::hypot(few.se[v], many.se[v])) << v;
        EXPECT_LT(few.se[v], 0.01 * many.mean[v]);
    }
}

// A striped table two cells high, seen at 45 degrees: its image at height 0 is that of its top, two pixels
// farther.
TEST(Relight, PixelsLieAtTheTopOrAtHeightZero) {
    constexpr int n = 8;
    HeightField table = make_height_field(n, n, 1, 1, std::vector<double>(n * n, 2.0));
    std::vector<float> stripes;
    for (int k = 0; k < n * n; ++k) stripes.push_back(0.1f * static_cast<float>(k % n));
    const Material material{{"y"}, Lambertian{Parameter::mapped(n, n, stripes)}};
    RelightPlan plan = plan_of(2);
    plan.outgoing = {{45, 0}};
    const auto images = [&](RelightPlan::Plane plane) {
        plan.plane = plane;
        return measure_relight(table, material, uniform_environment({1}), plan, {}).relit.images;
    };
    const std::vector<float> top = images(RelightPlan::Plane::top), zero = images(RelightPlan::Plane::zero);
    for (int i = 0; i < n; ++i) {
        EXPECT_NEAR(top[i], 0.1 * i, 1e-4);
        EXPECT_NEAR(zero[i], 0.1 * ((i + 2) % n), 1e-4);
    }
}

// A map that is black but for one texel: radiance over its irradiance is the BRDF of that direction, all
// orders.
TEST(Relight, ASunIsTheBrdfOfItsDirection) {
    const HeightField surface = generate_gaussian(48, 48, 1, 6, 0.8, 4);
    Environment sun;
    sun.nx = 720, sun.ny = 360, sun.n_channels = 1;
    sun.radiance.assign(static_cast<size_t>(sun.nx) * sun.ny, 0.0f);
    const int row = 90, column = 200;
    sun.radiance[static_cast<size_t>(row) * sun.nx + column] = 1000;
    const double theta = pi * (row + 0.5) / sun.ny, phi = pi * (1 - 2 * (column + 0.5) / sun.nx);
    const RelightPlan plan = plan_of(16);
    const Relit relit = measure_relight(surface, lambertian(0.7), sun, plan, {}).relit;

    BrdfPlan brdf;
    brdf.incident = {{degrees(theta), degrees(phi)}};
    brdf.outgoing = plan.outgoing;
    brdf.accuracy.target_relative_error = 0.004;
    const Table table = measure_brdf(surface, lambertian(0.7), brdf, {}).table;
    const double irradiance = horizontal_irradiance(sun, 0);
    for (int v = 0; v < 3; ++v) {
        const double expected = table.f[v] * irradiance;
        const double sigma = std::hypot(relit.se[v], std::hypot(table.se[v], table.bias[v]) * irradiance);
        EXPECT_NEAR(relit.mean[v], expected, 3.5 * sigma + relit.bias[v]) << v;
        EXPECT_LT(sigma, 0.02 * expected);
    }
}

TEST(Relight, AgreesWithThePathTracer) {
    const HeightField surface = generate_gaussian(48, 48, 1, 6, 0.8, 4);
    const Environment sky = test::uneven_sky();
    for (const int max_order : {1, 0}) {
        RelightPlan plan = plan_of(16);
        plan.max_order = max_order;
        const Relit relit = measure_relight(surface, lambertian(0.8), sky, plan, {}).relit;
        PathTracerOptions options;
        options.paths = 70000;
        options.max_order = max_order;
        for (int v = 0; v < 3; ++v) {
            const test::Traced traced =
                test::trace(surface, lambertian(0.8), sky, to_vector(plan.outgoing[v]), options);
            EXPECT_NEAR(relit.mean[v], traced.radiance,
                        3.5 * std::hypot(relit.se[v], traced.se) + relit.bias[v])
                << max_order << " " << v;
            EXPECT_LT(traced.se, 0.006 * traced.radiance);
        }
    }
}

TEST(Relight, SameBitsForAnyNumberOfThreads) {
    const HeightField surface = generate_gaussian(32, 40, 1, 5, 0.7, 9);
    RunOptions many;
    many.n_threads = 4;
    const Environment sky = uniform_environment({1, 2, 3});
    const Material material{{"r", "g", "b"}, Lambertian{0.5}};
    const Relit a = measure_relight(surface, material, sky, plan_of(2), {}).relit,
                b = measure_relight(surface, material, sky, plan_of(2), many).relit;
    EXPECT_EQ(a.radiance, b.radiance);
    EXPECT_EQ(a.images, b.images);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.se, b.se);
}

TEST(Relight, Refuses) {
    const HeightField surface = generate_gaussian(32, 32, 1, 5, 0.7, 9);
    const Material spectral{{"400nm", "500nm"}, Lambertian{0.5}};
    EXPECT_THROW(measure_relight(surface, spectral, uniform_environment({1, 2, 3}), plan_of(2), {}), Error);
    RunOptions little;
    little.max_bytes = 1 << 20;
    EXPECT_THROW(measure_relight(surface, lambertian(1), uniform_environment({1}), plan_of(2), little),
                 Error);
}

}  // namespace
}  // namespace gonio
