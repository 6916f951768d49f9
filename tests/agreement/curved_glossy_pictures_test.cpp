// Pictures and maps of glossy facets on curved bases: against Embree's rays through displaced reliefs, the
// Lambertian engine, and the BRDF.
#include <gtest/gtest.h>

#include <cstdio>

#include "agreement/curved_glossy.h"
#include "agreement/measured.h"
#include "base/half.h"
#include "measure/glossy_btf.h"
#include "measure/maps.h"

namespace gonio {
namespace {

constexpr int size = 32;

Material ggx(double alpha) {
    Microfacet lobe;
    lobe.alpha_x = lobe.alpha_y = alpha;
    lobe.reflectance.reflectance = 1.0;
    return {{"y"}, lobe};
}

struct Pictures {
    Btf btf;
    std::vector<std::vector<float>> images;  // [view], [light][pixel]
};

Pictures pictures(const HeightField& surface, const Material& material, const BtfPlan& plan) {
    const RunOptions options;
    const Monitor monitor;
    GlossyBtf glossy(surface, material, plan, options, monitor);
    Pictures result;
    result.btf = glossy.pictures([&](int, std::span<const uint16_t> images) {
        auto& values = result.images.emplace_back();
        for (const uint16_t half : images) values.push_back(from_half_bits(half));
    });
    return result;
}

// What pixels show: the lobe of the facet that a straight ray meets there, for a light told in the frame of
// that facet. The view is told in the frame of its middle, up to two thirds of a cell from where it is met,
// so that half vectors are off by up to a third of that turn: bounds are in units of the turn along a cell.
// Quantiles, for a few pixels show another facet.
TEST(CurvedGlossyPictures, ShowTheLobesOfDisplacedFacets) {
    for (const BaseCurvature& base :
         {BaseCurvature{1.0 / 60, 0, radians(30)}, BaseCurvature{1.0 / 240, 0, radians(30)},
          BaseCurvature{1.0 / 80, 1.0 / 80, 0}, BaseCurvature{-1.0 / 200, 0, 0}}) {
        const HeightField surface = relief_on(base);
        const double turn = std::abs(base.kappa_1);
        const Material material = ggx(0.2);
        BtfPlan plan;
        plan.incident = {{15, 0}, {20, 200}};
        plan.outgoing = {{0, 0}, {35, 20}, {60, 130}};
        plan.plane = BtfPlan::Plane::zero;
        plan.pixels_x = size;
        plan.pixels_y = 2 * size;  // no pixel's centre lies on the diagonal of a cell
        plan.max_order = 1;
        plan.accuracy.samples = Accuracy::Samples{8, 16, 1, 2};
        const Pictures measured = pictures(surface, material, plan);
        const auto patches = patches_of(surface);
        const FacetsInSpace facets(material);
        const int n = patches[0]->core(), rows = 2 * size;
        for (size_t v = 0; v < plan.outgoing.size(); ++v) {
            std::vector<double> off;
            double sum = 0, judged = 0;
            for (int j = 0; j < rows; ++j)
                for (int i = 0; i < size; ++i) {
                    const CurvedPatch& patch = *patches[j / 2 / n * (size / n) + i / n];
                    const double x = i % n + 0.5, y = j / 2 % n + 0.25 + 0.5 * (j % 2);
                    const Vec3 view = to_vector(plan.outgoing[v]);
                    CurvedPatch::Point hit, other;
                    if (!patch.see(x, y, view, &hit)) continue;
                    const Vec3 wo = turned_direction(view, base, -(x - 0.5 * n), -(y - 0.5 * n));
                    for (size_t l = 0; l < plan.incident.size(); ++l) {
                        const Vec3 light = to_vector(plan.incident[l]), wi = hit.in_space(light, base);
                        const bool lit = !patch.trace(hit.position, wi, &other);
                        const double f = lit ? facets.f(hit.normal, wi, wo) *
                                                   std::max(0.0, dot(hit.normal, wi)) / light.z
                                             : 0,
                                     value = measured.images[v][(l * rows + j) * size + i];
                        sum += value;
                        judged += f;
                        if (f > 0.05) off.push_back(std::abs(value / f - 1));
                    }
                }
            std::sort(off.begin(), off.end());
            std::printf("kappa %g view %g: median %.5f, 90 %% %.4f, mean %+.4f\n", base.kappa_1,
                        plan.outgoing[v].theta_deg, off[off.size() / 2], off[off.size() * 9 / 10],
                        sum / judged - 1);
            EXPECT_LT(off[off.size() / 2], 0.6 * turn + 0.001);
            EXPECT_LT(off[off.size() * 9 / 10], 2.5 * turn + 0.003);
            EXPECT_NEAR(sum / judged, 1, 0.3 * turn + 0.002);
        }
    }
}

// All orders, pixel by pixel: Lambertian facets by both engines.
TEST(CurvedGlossyPictures, OfLambertianFacetsAreThoseOfTheOtherEngine) {
    for (const BaseCorrection correction : {BaseCorrection::none, BaseCorrection::exact}) {
        HeightField surface = relief_on({1.0 / 60, -1.0 / 150, 0.4});
        if (correction != BaseCorrection::none) surface.base = {1.0 / 60, 1.0 / 60, 0, correction};
        BtfPlan plan;
        plan.incident = {{10, 0}, {40, 40}, {60, 200}};
        plan.outgoing = {{0, 0}, {45, 10}, {60, 130}};
        plan.plane = BtfPlan::Plane::zero;
        plan.accuracy.samples = Accuracy::Samples{4, 256, 1, 4};
        const Pictures glossy = pictures(surface, gray({0.8}), plan);
        const Btf lambertian = measure_btf(surface, gray({0.8}), plan, {}).btf;
        const BtfShape& shape = lambertian.shape;
        const size_t n = shape.n_pixels();
        std::vector<uint16_t> images(shape.images_size() / shape.n_views);
        for (int v = 0; v < shape.n_views; ++v) {
            expand_view(shape, lambertian.radiance, lambertian.view_maps, v, images);
            for (size_t l = 0; l < plan.incident.size(); ++l) {
                double squares = 0, sum = 0, other = 0;
                for (size_t p = 0; p < n; ++p) {
                    const double a = glossy.images[v][l * n + p], b = from_half_bits(images[l * n + p]);
                    squares += (a - b) * (a - b) / static_cast<double>(n);
                    sum += a;
                    other += b;
                }
                EXPECT_LE(std::sqrt(squares),
                          1.5 * std::hypot(glossy.btf.pixel_se[l], lambertian.pixel_se[l]));
                // Moved directions count one way in the graph and both ways in the operator.
                EXPECT_NEAR(sum / other, 1, correction == BaseCorrection::none ? 0.002 : 0.006)
                    << v << " " << l;
            }
        }
    }
}

// Light that arrives on glossy facets, direct and over others.
TEST(CurvedGlossyMaps, HoldTheIrradianceOfTracedPaths) {
    for (const BaseCurvature& base :
         {BaseCurvature{1.0 / 60, 0, radians(30)}, BaseCurvature{-1.0 / 200, 0, 0}}) {
        const HeightField surface = relief_on(base);
        const std::vector<AnglesDeg> lights{{30, 10}, {60, 75}};
        MapsPlan plan;
        plan.incident = lights;
        plan.sky_directions = 0;
        plan.max_order = 2;
        plan.accuracy.samples = Accuracy::Samples{8, 256, 1, 8};
        const Maps maps = measure_maps(surface, ggx(0.3), plan, {}).maps;
        auto mean = [&](size_t l, const char* part) {
            for (const MapLayer& one : maps.layers)
                if (one.name == "light00" + std::to_string(l) + part) return one.mean;
            ADD_FAILURE() << part;
            return 0.0;
        };
        const auto owned = patches_of(surface);
        std::vector<CurvedPatch*> patches;
        for (const auto& p : owned) patches.push_back(p.get());
        std::vector<Vec3> wi;
        for (const AnglesDeg& light : lights) wi.push_back(to_vector(light));
        const auto traced = trace_glossy(patches, ggx(0.3), wi, {}, 2, 400000, 7);
        for (size_t l = 0; l < lights.size(); ++l) {
            const auto &first = traced[l].orders[0], &second = traced[l].orders[1];
            const double direct = mean(l, ".direct.y"), indirect = mean(l, ".indirect.y");
            std::printf("light %g: direct %.5f, traced %.5f (%.5f); indirect %.5f, traced %.5f (%.5f)\n",
                        lights[l].theta_deg, direct, first.mean, first.se, indirect, second.mean, second.se);
            // 256 directions and 64 places leave a fifth of a percent of the light.
            EXPECT_NEAR(direct, first.mean, 3.5 * std::hypot(first.se, 0.002 * first.mean));
            EXPECT_NEAR(indirect, second.mean, 3.5 * std::hypot(second.se, 0.01 * second.mean));
        }
    }
}

}  // namespace
}  // namespace gonio
