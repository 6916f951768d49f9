// Light from all around: horizon slices against the path tracer, and the path tracer against furnaces.
#include <gtest/gtest.h>

#include <cmath>

#include "agreement/traced_sky.h"
#include "base/random.h"
#include "scattering/environment_slices.h"
#include "scattering/path_tracer.h"
#include "surface/generate.h"

namespace gonio {
namespace {

using test::Traced;

PathTracerOptions with(long long paths, int max_order) {
    PathTracerOptions options;
    options.paths = paths, options.max_order = max_order;
    return options;
}

// The first order: irradiance from slices and what the view sees, at one random place inside the facets a
// run.
TEST(EnvironmentLight, SlicesAgreeWithThePathTracer) {
    constexpr double albedo = 0.8;
    constexpr int runs = 12;
    const HeightField surface = generate_gaussian(48, 48, 1, 6, 0.8, 4);
    const MarchGrid grid = make_march_grid(surface);
    const CellRect all{0, 0, surface.nx, surface.ny};
    const Tile tile = make_tile(surface, all, all, 1);
    const Environment sky = test::uneven_sky();
    const std::vector<Vec3> views{to_vector({0, 0}), to_vector({45, 30}), to_vector({70, 200})};
    std::vector<double> sum(views.size()), squares(views.size());
    for (int run = 0; run < runs; ++run) {
        const auto word = random_words(3, run, 0);
        const SubSample place{uniform_double(word[0]), uniform_double(word[1])};
        const Fields irradiance = sky_irradiance(
            grid, tile, sky, place, {.azimuths = 16, .shift = uniform_double(word[2]), .horizon = {}}, 1, {});
        const Irradiance seen = compute_irradiance(grid, tile, views, views, true, {place}, {}, true, 1, {});
        for (size_t v = 0; v < views.size(); ++v) {
            double sent = 0, projected = 0;
            for (size_t u = 0; u < tile.n_unknowns(); ++u) {
                const double g = seen.lights.block(0)[u * column_block + v];
                sent += g * albedo / pi * irradiance.block(0)[u * column_block];
                projected += g * tile.sqrt_area[u];
            }
            sum[v] += sent / projected;
            squares[v] += std::pow(sent / projected, 2);
        }
    }
    for (size_t v = 0; v < views.size(); ++v) {
        const double mean = sum[v] / runs, se = std::sqrt((squares[v] / runs - mean * mean) / (runs - 1));
        const Traced traced =
            test::trace(surface, {{"y"}, Lambertian{albedo}}, sky, views[v], with(60000, 1));
        EXPECT_NEAR(mean, traced.radiance, 3.5 * std::hypot(se, traced.se)) << v;
        EXPECT_LT(std::hypot(se, traced.se), 0.01 * mean) << v;
    }
}

// Whatever reflects all light cannot be told from a uniform sky; mirrors are met, too.
TEST(EnvironmentLight, FurnacesOfMirrorsAndLambertians) {
    const HeightField surface = generate_gaussian(32, 32, 1, 5, 0.9, 2);
    const Material mirror{{"y"}, Mirror{{1.0, {}, {}}}}, white{{"y"}, Lambertian{1.0}};
    for (const Material& material : {mirror, white}) {
        const Traced traced =
            test::trace(surface, material, uniform_environment({1}), to_vector({50, 20}), with(4096, 0));
        EXPECT_NEAR(traced.radiance, 1, 2e-3) << "but for rays lost between facets";
    }
    // One bounce off a grey mirror: at most its reflectance, less what meets the relief again.
    const Traced grey = test::trace(surface, {{"y"}, Mirror{{0.5, {}, {}}}}, uniform_environment({1}),
                                    to_vector({50, 20}), with(20000, 1));
    EXPECT_LT(grey.radiance, 0.5);
    EXPECT_GT(grey.radiance, 0.35);
}

}  // namespace
}  // namespace gonio
