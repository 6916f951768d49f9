// Mirrors under environments, alone and in mixtures: the plane, the furnace, the groove that sends light back
// where it came from, the path tracer.
#include <algorithm>

#include "agreement/measured.h"
#include "agreement/relit.h"
#include "base/error.h"
#include "material/fresnel.h"
#include "measure/relight.h"
#include "surface/generate.h"

namespace gonio {
namespace {

using test::of;
using test::relit_field;

// Not the zenith, where a map has a value for each of its columns.
const std::vector<AnglesDeg> views = {{5, 0}, {45, 30}, {70, 200}};

Lobe mirror(double reflectance = 1) {
    Mirror lobe;
    lobe.reflectance.reflectance = reflectance;
    return lobe;
}
RelightPlan plan_of(int replicates, int sub_samples = 1, int max_order = 0) {
    RelightPlan plan;
    plan.outgoing = views;
    plan.max_order = max_order;
    plan.accuracy.samples = Accuracy::Samples{sub_samples, 64, 1, replicates};
    return plan;
}
RelightResult relit(const HeightField& surface, const Material& material, const Environment& sky,
                    const RelightPlan& plan, int n_threads = 1) {
    RunOptions options;
    options.n_threads = n_threads;
    return measure_relight(surface, material, sky, plan, options);
}
Vec3 mirrored(const AnglesDeg& view) {
    const Vec3 d = to_vector(view);
    return {-d.x, -d.y, d.z};
}
// Black but for one texel; where that is.
struct Sun {
    Environment sky;
    AnglesDeg direction;
};
Sun sun() {
    Environment sky;
    sky.nx = 720, sky.ny = 360, sky.n_channels = 1;
    sky.radiance.assign(static_cast<size_t>(sky.nx) * sky.ny, 0.0f);
    const int row = 90, column = 200;
    sky.radiance[static_cast<size_t>(row) * sky.nx + column] = 1000;
    return {sky, {180 * (row + 0.5) / sky.ny, 180 * (1 - 2 * (column + 0.5) / sky.nx)}};
}

TEST(MirrorRelight, APlaneShowsTheSkyMirrored) {
    Mirror silver;
    silver.reflectance.eta = Parameter(0.15), silver.reflectance.k = Parameter(3.6);
    const Environment sky = test::uneven_sky();
    for (const double weight : {1.0, 0.25}) {
        const Relit plane = relit(generate_plane(8, 1), of({{weight, Lobe{silver}}}), sky, plan_of(4)).relit;
        for (size_t v = 0; v < views.size(); ++v) {
            const double cosine = to_vector(views[v]).z,
                         expected =
                             weight * fresnel_conductor(cosine, 0.15, 3.6) * sky.at(0, mirrored(views[v]));
            EXPECT_NEAR(plane.mean[v], expected, 1e-5 * expected) << v;
            EXPECT_NEAR(plane.images[v * 64 + 9], expected, 1e-5 * expected) << v;
            EXPECT_LT(plane.se[v], 1e-5 * expected);
            EXPECT_EQ(plane.bias[v], 0);
        }
    }
}

TEST(MirrorRelight, ASunIsSeenInOneDirectionOnly) {
    const auto [sky, direction] = sun();
    RelightPlan plan = plan_of(4);
    plan.outgoing = {{direction.theta_deg, direction.phi_deg + 180},
                     {direction.theta_deg, direction.phi_deg + 182},
                     {direction.theta_deg + 2, direction.phi_deg + 180}};
    const Relit plane = relit(generate_plane(8, 1), of({{1.0, mirror(0.5)}}), sky, plan).relit;
    EXPECT_NEAR(plane.mean[0], 500, 0.5);
    EXPECT_EQ(plane.mean[1], 0);
    EXPECT_EQ(plane.mean[2], 0);
}

// What is mixed with a mirror is lit by a sun that reflections of its own would hardly ever meet.
TEST(MirrorRelight, AMixtureOnAPlaneIsItsParts) {
    for (const Environment& sky : {sun().sky, test::uneven_sky()}) {
        const Relit plane =
            relit(generate_plane(32, 1), of({{0.4, mirror(0.9)}, {0.6, Lambertian{0.8}}}), sky, plan_of(16))
                .relit;
        for (size_t v = 0; v < views.size(); ++v) {
            const double expected =
                0.36 * sky.at(0, mirrored(views[v])) + 0.48 / pi * horizontal_irradiance(sky, 0);
            EXPECT_NEAR(plane.mean[v], expected, 3.5 * plane.se[v]) << v;
            EXPECT_LT(plane.se[v], 0.02 * expected) << v;
        }
    }
}

// A white mirror shows a white sky wherever it looks; of what reflects a half, each order is what the limit
// on the orders tells it from.
TEST(MirrorRelight, Furnace) {
    const Relit white =
        relit(relit_field(), of({{1.0, mirror()}}), uniform_environment({1}), plan_of(4)).relit;
    for (size_t v = 0; v < views.size(); ++v) EXPECT_NEAR(white.mean[v], 1, 1e-5 + 2 * white.bias[v]) << v;
    EXPECT_LT(white.bias[0], 1e-4);
    for (const float radiance : white.images) ASSERT_NEAR(radiance, 1, 1e-4);
    const Relit mixed = relit(relit_field(), of({{0.5, mirror()}, {0.5, Lambertian{1.0}}}),
                              uniform_environment({1}), plan_of(16))
                            .relit;
    for (size_t v = 0; v < views.size(); ++v) {
        EXPECT_NEAR(mixed.mean[v], 1, 3.5 * mixed.se[v] + mixed.bias[v]) << v;
        EXPECT_LT(mixed.se[v], 0.01);
    }
    std::vector<double> share;  // of the light that takes so many reflections
    for (const int order : {1, 2, 3, 4}) {
        const auto mean = [&](double reflectance) {
            return relit(relit_field(), of({{1.0, mirror(reflectance)}}), uniform_environment({1}),
                         plan_of(4, 1, order))
                .relit.mean[1];
        };
        const double white_to = mean(1), half_to = mean(0.5);
        share.push_back(white_to);
        double expected = 0;
        for (size_t k = 0; k < share.size(); ++k)
            expected += std::pow(0.5, k + 1) * (share[k] - (k > 0 ? share[k - 1] : 0.0));
        EXPECT_NEAR(half_to, expected, 1e-5) << order;
    }
    EXPECT_GT(share[1], share[0] + 0.005);
}

// Across a right-angled groove light goes back where it came from, after two reflections; along it, it goes
// on.
TEST(MirrorRelight, ARightAngledGrooveSendsLightBack) {
    const HeightField groove = generate_v_groove(64, 2, 45);
    const Environment sky = test::uneven_sky();
    RelightPlan plan = plan_of(4, 4, 2);
    plan.outgoing = {{30, 90}};
    const Material white = of({{1.0, mirror(0.9)}});
    const Relit lit = relit(groove, white, sky, plan).relit;
    const double expected = 0.81 * sky.at(0, mirrored(plan.outgoing[0]));
    EXPECT_NEAR(lit.mean[0], expected, 1e-4 * expected);
    plan.max_order = 1;
    EXPECT_EQ(relit(groove, white, sky, plan).relit.mean[0], 0);
}

TEST(MirrorRelight, AgreesWithThePathTracer) {
    const Environment sky = test::uneven_sky();
    Microfacet rough;
    rough.alpha_x = rough.alpha_y = 0.3;
    rough.reflectance.reflectance = 0.9;
    const std::vector<Material> materials = {of({{1.0, mirror(0.9)}}),
                                             of({{0.5, mirror(0.9)}, {0.5, Lambertian{0.8}}}),
                                             of({{0.3, mirror(0.8)}, {0.7, Lobe{rough}}})};
    for (size_t m = 0; m < materials.size(); ++m)
        for (const int max_order : {1, 2, 0}) {
            const Relit lit =
                relit(relit_field(), materials[m], sky, plan_of(m == 0 ? 4 : 16, m == 0 ? 4 : 1, max_order))
                    .relit;
            PathTracerOptions options;
            options.paths = 20000;
            options.max_order = max_order;
            SCOPED_TRACE("material " + std::to_string(m) + ", max_order " + std::to_string(max_order));
            test::expect_what_paths_see(lit, materials[m], sky, views, options, 0.001);
        }
}

// How far few runs are from many is what they say, of means and of single facets.
TEST(MirrorRelight, StatesItsErrors) {
    const Material material = of({{0.4, mirror(0.9)}, {0.6, Lambertian{0.8}}});
    RelightPlan plan = plan_of(4);
    const Relit few = relit(relit_field(), material, test::uneven_sky(), plan).relit;
    plan.accuracy.samples->replicates = 32;
    plan.accuracy.seed = 2;
    const Relit many = relit(relit_field(), material, test::uneven_sky(), plan).relit;
    double squares = 0;
    for (size_t k = 0; k < few.radiance.size(); ++k)
        squares += std::pow(few.radiance[k] - many.radiance[k], 2) / static_cast<double>(few.radiance.size());
    EXPECT_NEAR(std::sqrt(squares), std::hypot(few.radiance_se[0], many.radiance_se[0]),
                0.1 * few.radiance_se[0]);
    for (size_t v = 0; v < views.size(); ++v)
        EXPECT_NEAR(few.mean[v], many.mean[v], 3.5 * std::hypot(few.se[v], many.se[v])) << v;
}

// Parts of facets are places of their own: where facets are as large as what they hide from each other, the
// part that is looked from matters.
TEST(MirrorRelight, RefinementChangesNothingButPlaces) {
    const HeightField coarse = generate_gaussian(24, 24, 1, 1.5, 1.2, 4);
    const Material material = of({{1.0, mirror(0.5)}});
    RelightPlan plan = plan_of(16, 4);
    const Relit whole = relit(coarse, material, test::uneven_sky(), plan).relit;
    plan.accuracy.samples->refinement = 2;
    const Relit parts = relit(coarse, material, test::uneven_sky(), plan).relit;
    EXPECT_EQ(parts.radiance.size(), 4 * whole.radiance.size());
    for (size_t v = 0; v < views.size(); ++v) {
        const double sigma = std::hypot(parts.se[v], whole.se[v]);
        EXPECT_NEAR(parts.mean[v], whole.mean[v], 3.5 * sigma) << v;
        EXPECT_LT(sigma, 0.004 * whole.mean[v]) << v;
    }
}

TEST(MirrorRelight, SameBitsForAnyNumberOfThreads) {
    const HeightField surface = generate_gaussian(32, 40, 1, 5, 0.7, 9);
    const Material material = of({{0.5, mirror(0.9)}, {0.5, Lambertian{{0.5, 0.7, 0.9}}}}, {"r", "g", "b"});
    const Relit a = relit(surface, material, test::uneven_sky(), plan_of(2)).relit,
                b = relit(surface, material, test::uneven_sky(), plan_of(2), 4).relit;
    EXPECT_EQ(a.radiance, b.radiance);
    EXPECT_EQ(a.images, b.images);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_GT(a.mean[2 * views.size()], 1.1 * a.mean[0]);
}

TEST(MirrorRelight, RefusesWhatOthersRefuse) {
    HeightField curved = relit_field();
    curved.base.kappa_1 = 1e-3;
    EXPECT_THROW(relit(curved, of({{1.0, mirror()}}), uniform_environment({1}), plan_of(2)), Error);
    EXPECT_THROW(relit(relit_field(), of({{1.0, mirror()}}, {"400nm", "500nm"}),
                       uniform_environment({1, 2, 3}), plan_of(2)),
                 Error);
}

}  // namespace
}  // namespace gonio
