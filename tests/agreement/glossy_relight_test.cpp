// Glossy facets under environments: the plane and its directional albedo, the furnace, a sun that must be
// what a BRDF says of its direction, the path tracer.
#include <algorithm>

#include "agreement/measured.h"
#include "agreement/relit.h"
#include "base/error.h"
#include "material/facet_brdf.h"
#include "measure/relight.h"
#include "surface/generate.h"

namespace gonio {
namespace {

using test::of;
using test::relit_field;

const std::vector<AnglesDeg> views = {{0, 0}, {45, 30}, {70, 200}};

Lobe ggx(double alpha_x, double alpha_y, double reflectance = 1) {
    Microfacet lobe;
    lobe.alpha_x = alpha_x, lobe.alpha_y = alpha_y;
    lobe.reflectance.reflectance = reflectance;
    return lobe;
}
// Lambertian, but not known for it.
Material white_mixture() {
    return of({{0.5, Lambertian{1.0}}, {0.5, Lambertian{1.0}}});
}

RelightPlan plan_of(int replicates, int sub_samples = 1) {
    RelightPlan plan;
    plan.outgoing = views;
    plan.accuracy.samples = Accuracy::Samples{sub_samples, 128, 1, replicates};
    return plan;
}
Relit relit(const HeightField& surface, const Material& material, const Environment& sky,
            const RelightPlan& plan, int n_threads = 1) {
    RunOptions options;
    options.n_threads = n_threads;
    return measure_relight(surface, material, sky, plan, options).relit;
}

// Share of the light of a view's direction that a plane reflects, by the midpoint rule.
double directional_albedo(const Material& material, const Vec3& view) {
    const HeightField plane = generate_plane(2, 1);
    const FacetBrdf facet(material, plane, 0, 0, 0);
    constexpr int n = 600;
    double sum = 0;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < 2 * n; ++i) {
            const double z2 = (j + 0.5) / n, r = std::sqrt(1 - z2), phi = pi * (i + 0.5) / n;
            double f = 0;
            facet.eval({r * std::cos(phi), r * std::sin(phi), std::sqrt(z2)}, view, {&f, 1});
            sum += f;
        }
    return sum * pi / (2.0 * n * n);
}

TEST(GlossyRelight, APlaneReflectsItsDirectionalAlbedo) {
    for (const Lobe& lobe : {ggx(0.3, 0.3), ggx(0.15, 0.5), Lobe{Phong{20.0, 0.8}}}) {
        const Material material = of({{1.0, lobe}});
        const Relit plane = relit(generate_plane(8, 1), material, uniform_environment({2}), plan_of(32));
        for (size_t v = 0; v < views.size(); ++v) {
            const double expected = 2 * directional_albedo(material, to_vector(views[v]));
            EXPECT_NEAR(plane.mean[v], expected, 3.5 * plane.se[v] + 1e-3 * expected) << v;
            EXPECT_LT(plane.se[v], 0.01 * expected);
            EXPECT_NEAR(plane.images[v * 64 + 9], plane.mean[v], 1e-4 * expected);
        }
    }
}

// Under a white sky a view receives what a light from there would lose into the sky. Of lobes of alpha 1e-4
// hardly any look meets that: the bias knows.
TEST(GlossyRelight, KnowsWhatNarrowLobesHide) {
    const HeightField relief = relit_field();
    for (const double alpha : {0.05, 1e-3, 1e-5}) {
        const Material material = of({{1.0, ggx(alpha, alpha)}});
        const Relit found = relit(relief, material, uniform_environment({2}), plan_of(6));
        BrdfPlan plan;
        plan.incident = views;
        plan.outgoing_cells = equal_cells(1);
        plan.outgoing = centres(plan.outgoing_cells);
        plan.accuracy.samples = Accuracy::Samples{4, 64, 1, 4};
        const Table reflected = measure(relief, material, plan).table;
        double missed = 0;
        for (size_t v = 0; v < views.size(); ++v) {
            const double expected = 2 * pi * reflected.f[v];
            const double sigma = std::hypot(found.se[v], found.bias[v]);
            EXPECT_LE(std::abs(found.mean[v] - expected), 3 * sigma) << alpha << " " << v;
            if (alpha == 0.05) {
                EXPECT_LT(sigma, 0.03 * expected);
            }
            missed += std::pow(found.bias[v], 2) / static_cast<double>(views.size());
        }
        EXPECT_GT(found.radiance_se[0], std::sqrt(missed));
    }
}

// What is lost is what single scattering on the facets loses: nothing of a white mixture, and of GGX more
// than its least directional albedo lets through in each order.
TEST(GlossyRelight, Furnace) {
    const Relit white = relit(relit_field(), white_mixture(), uniform_environment({1}), plan_of(8));
    const Relit metal =
        relit(relit_field(), of({{1.0, ggx(0.4, 0.4)}}), uniform_environment({1}), plan_of(8));
    double least = 1, most = 0;
    for (int theta = 0; theta < 90; theta += 5) {
        const double albedo = directional_albedo(of({{1.0, ggx(0.4, 0.4)}}), to_vector({theta + 0.5, 0}));
        least = std::min(least, albedo), most = std::max(most, albedo);
    }
    for (size_t v = 0; v < views.size(); ++v) {
        EXPECT_NEAR(white.mean[v], 1, 3.5 * white.se[v] + white.bias[v]) << v;
        EXPECT_LT(white.se[v], 0.005);
        EXPECT_LT(white.bias[v], 0.03);
        EXPECT_LT(metal.mean[v] - 3.5 * metal.se[v] - metal.bias[v], most);
        EXPECT_GT(metal.mean[v] + 3.5 * metal.se[v] + metal.bias[v], std::pow(least, 4));
    }
}

// The same light by two engines, facet by facet: Lambertian facets, in colour.
TEST(GlossyRelight, OfLambertianFacetsIsThatOfTheOtherEngine) {
    Environment sky = test::uneven_sky();
    sky.n_channels = 3;
    const std::vector<float> grey = sky.radiance;
    for (const float factor : {0.1f, 4.0f})
        for (size_t k = 0; k < grey.size(); ++k) sky.radiance.push_back(factor * grey[(k * 5) % grey.size()]);
    const std::vector<std::string> rgb = {"r", "g", "b"};
    const Lobe lobe = Lambertian{{0.9, 0.5, 0.2}};
    const RelightPlan plan = plan_of(16);
    const Relit expected = relit(relit_field(), of({{1.0, lobe}}, rgb), sky, plan),
                glossy = relit(relit_field(), of({{0.25, lobe}, {0.75, lobe}}, rgb), sky, plan);
    ASSERT_EQ(glossy.radiance.size(), 3 * expected.radiance.size());
    for (size_t c = 0; c < 3; ++c) {
        for (size_t v = 0; v < 3; ++v)
            EXPECT_NEAR(
                glossy.mean[c * 3 + v], expected.mean[c * 3 + v],
                3.5 * std::hypot(glossy.se[c * 3 + v], expected.se[c * 3 + v]) + expected.bias[c * 3 + v])
                << c << " " << v;
        // Of single facets, but for those that face away from the view.
        double squares = 0, n = 0;
        for (size_t facet = 0; facet < expected.n_facets; ++facet)
            if (const float own = glossy.radiance[(c * 3 + 1) * expected.n_facets + facet]; own > 0) {
                squares += std::pow(own - expected.radiance[c * expected.n_facets + facet], 2);
                n += 1;
            }
        EXPECT_LT(std::sqrt(squares / n), 1.6 * std::hypot(glossy.radiance_se[c], expected.radiance_se[c]));
        EXPECT_GT(n, 0.7 * static_cast<double>(expected.n_facets));
    }
}

// A map that is black but for one texel: radiance over its irradiance is the BRDF of that direction.
TEST(GlossyRelight, ASunIsTheBrdfOfItsDirection) {
    Environment sun;
    sun.nx = 720, sun.ny = 360, sun.n_channels = 1;
    sun.radiance.assign(static_cast<size_t>(sun.nx) * sun.ny, 0.0f);
    const int row = 90, column = 200;
    sun.radiance[static_cast<size_t>(row) * sun.nx + column] = 1000;
    const double theta = pi * (row + 0.5) / sun.ny, phi = pi * (1 - 2 * (column + 0.5) / sun.nx);
    const Material material = of({{0.6, ggx(0.2, 0.4, 0.9)}, {0.4, Lambertian{0.8}}});
    const Relit lit = relit(relit_field(), material, sun, plan_of(16));
    BrdfPlan brdf = plan_for_target({{degrees(theta), degrees(phi)}}, views, 0.004);
    const Table table = measure_brdf(relit_field(), material, brdf, {}).table;
    const double irradiance = horizontal_irradiance(sun, 0);
    for (size_t v = 0; v < views.size(); ++v) {
        const double expected = table.f[v] * irradiance,
                     sigma = std::hypot(lit.se[v], std::hypot(table.se[v], table.bias[v]) * irradiance);
        EXPECT_NEAR(lit.mean[v], expected, 3.5 * sigma + lit.bias[v]) << v;
        EXPECT_LT(sigma, 0.02 * expected);
    }
}

TEST(GlossyRelight, AgreesWithThePathTracer) {
    const Environment sky = test::uneven_sky();
    const std::vector<Material> materials = {of({{1.0, ggx(0.3, 0.3)}}), of({{1.0, ggx(0.1, 0.4, 0.8)}}),
                                             of({{0.5, Lambertian{0.9}}, {0.5, Phong{30.0, 0.9}}}),
                                             of({{1.0, CoatedDiffuse{1.5, 0.2, 0.8}}})};
    for (size_t m = 0; m < materials.size(); ++m)
        for (const int max_order : {1, 0}) {
            RelightPlan plan = plan_of(8, m == 0 ? 2 : 1);
            plan.max_order = max_order;
            const Relit lit = relit(relit_field(), materials[m], sky, plan);
            PathTracerOptions options;
            options.paths = max_order == 1 ? 8000 : 16000;
            options.max_order = max_order;
            SCOPED_TRACE("material " + std::to_string(m) + ", max_order " + std::to_string(max_order));
            test::expect_what_paths_see(lit, materials[m], sky, views, options, 0.02);
        }
}

// A quarter of a turn of everything: relief, brushed facets, sky and views.
TEST(GlossyRelight, TurnsWithReliefAndSky) {
    const HeightField surface = relit_field();
    HeightField turned = surface;
    const int n = surface.nx;
    for (int j = 0; j < n; ++j)  // (x, y) goes to (-y, x); nodes wrap
        for (int i = 0; i < n; ++i)
            turned.heights[static_cast<size_t>(i) * n + (n - j) % n] =
                surface.heights[static_cast<size_t>(j) * n + i];
    Microfacet brushed = std::get<Microfacet>(ggx(0.1, 0.5, 0.9));
    const Material material = of({{1.0, brushed}});
    brushed.rotation_deg = 90.0;
    Environment sky = test::uneven_sky();
    const RelightPlan plan = plan_of(16);
    const Relit before = relit(surface, material, sky, plan);
    sky.rotation += pi / 2;
    RelightPlan turned_plan = plan;
    for (AnglesDeg& view : turned_plan.outgoing) view.phi_deg += 90;
    const Relit after = relit(turned, of({{1.0, brushed}}), sky, turned_plan);
    for (size_t v = 0; v < views.size(); ++v) {
        // The diagonals of the cells do not turn along.
        EXPECT_NEAR(after.mean[v], before.mean[v],
                    3.5 * std::hypot(before.se[v], after.se[v]) + before.bias[v] + 0.01 * before.mean[v])
            << v;
        EXPECT_LT(before.se[v], 0.01 * before.mean[v]);
    }
}

TEST(GlossyRelight, ChannelsHaveLightOfTheirOwn) {
    const Material one = of({{1.0, ggx(0.3, 0.3, 0.9)}});
    const Material three = of(one.lobes, {"r", "g", "b"});
    RelightPlan plan = plan_of(2);
    plan.accuracy.samples->directions = 64;
    const Relit grey = relit(relit_field(), one, uniform_environment({1}), plan),
                colour = relit(relit_field(), three, uniform_environment({1, 0, 3}), plan);
    for (size_t v = 0; v < views.size(); ++v) {
        EXPECT_NEAR(colour.mean[v], grey.mean[v], 1e-5);
        EXPECT_EQ(colour.mean[3 + v], 0);
        EXPECT_NEAR(colour.mean[6 + v], 3 * grey.mean[v], 3e-5);
    }
}

TEST(GlossyRelight, SameBitsForAnyNumberOfThreads) {
    const HeightField surface = generate_gaussian(32, 40, 1, 5, 0.7, 9);
    const Material material = of({{0.5, ggx(0.3, 0.3)}, {0.5, Lambertian{0.5}}});
    RelightPlan plan = plan_of(2);
    plan.accuracy.samples->directions = 64;
    const Relit a = relit(surface, material, test::uneven_sky(), plan),
                b = relit(surface, material, test::uneven_sky(), plan, 4);
    EXPECT_EQ(a.radiance, b.radiance);
    EXPECT_EQ(a.images, b.images);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.se, b.se);
}

TEST(GlossyRelight, RefusesColoursOnASpectrum) {
    const Material spectral{{"400nm", "500nm"}, Phong{10.0, 0.5}};
    EXPECT_THROW(relit(relit_field(), spectral, uniform_environment({1, 2, 3}), plan_of(2)), Error);
}

}  // namespace
}  // namespace gonio
