// Maps and BTFs on curved bases, against rays of Embree through reliefs that are really displaced from
// cylinders and spheres.
#include <gtest/gtest.h>

#include <cstdio>

#include "agreement/curved_patch.h"
#include "agreement/measured.h"
#include "base/error.h"
#include "measure/btf.h"
#include "measure/glossy_btf.h"
#include "measure/maps.h"
#include "measure/relight.h"
#include "validation/statistics.h"
#include "visibility/crossings.h"

namespace gonio {
namespace {

constexpr int size = 32;

class CurvedPictures : public ::testing::TestWithParam<BaseCurvature> {};

const MapLayer& layer(const Maps& maps, const std::string& name) {
    for (const MapLayer& one : maps.layers)
        if (one.name == name) return one;
    ADD_FAILURE() << "no layer " << name;
    return maps.layers.front();
}

// Shares of each cell that are lit, and the light that facets send back in all, as means over the period.
TEST_P(CurvedPictures, Maps) {
    const HeightField surface = relief_on(GetParam());
    const std::vector<AnglesDeg> lights{{30, 10}, {60, 75}, {75, 140}};
    constexpr double albedo = 0.8;
    MapsPlan plan;
    plan.incident = lights;
    plan.outgoing = {lights[1]};
    plan.sky_directions = 0;
    plan.accuracy.samples = Accuracy::Samples{8, 256, 1, 8};
    const Maps maps = measure_maps(surface, gray({albedo}), plan, {}).maps;
    const auto owned = patches_of(surface);
    std::vector<CurvedPatch*> patches;
    for (const auto& p : owned) patches.push_back(p.get());
    std::vector<Vec3> wi;
    for (const AnglesDeg& light : lights) wi.push_back(to_vector(light));
    EXPECT_EQ(layer(maps, "light001.shadow").pixels, layer(maps, "view000.mask").pixels);

    // Of places of their own: two shares of n places each differ by sqrt(2 / 4 n) at most in rms.
    constexpr int places = 64;
    for (size_t l = 0; l < lights.size(); ++l) {
        double squares = 0, mean = 0;
        for (size_t k = 0; k < patches.size(); ++k) {
            const int n = patches[k]->core(), x0 = static_cast<int>(k) % (size / n) * n,
                      y0 = static_cast<int>(k) / (size / n) * n;
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) {
                    int lit = 0;
                    for (int s = 0; s < 2 * places; ++s) {
                        const FacetPoint at = facet_point(s % 2, fractional_part(0.7548776662466927 * s),
                                                          fractional_part(0.5698402909980532 * s));
                        const CurvedPatch::Point p = patches[k]->point(i, j, s % 2, at.u, at.v);
                        const Vec3 w = p.in_space(wi[l], surface.base);
                        CurvedPatch::Point hit;
                        lit += dot(w, p.normal) > 0 && !patches[k]->trace(p.position, w, &hit);
                    }
                    const double off = layer(maps, "light00" + std::to_string(l) + ".shadow")
                                           .pixels[(y0 + j) * size + x0 + i] -
                                       0.5 * lit / places;
                    mean += off / (size * size);
                    squares += off * off / (size * size);
                }
        }
        EXPECT_LT(std::sqrt(squares), 0.03) << lights[l].theta_deg;
        EXPECT_LT(std::abs(mean), 0.004) << lights[l].theta_deg;
    }

    const auto traced = trace_view(patches, wi, {}, 2, albedo, 400000, 5);
    for (size_t l = 0; l < lights.size(); ++l) {
        const std::string name = "light00" + std::to_string(l);
        const double total = layer(maps, name + ".total.c0").mean,
                     direct = layer(maps, name + ".direct.c0").mean,
                     first = albedo * traced[l].orders[0].mean;
        std::printf("light %g: direct %.5f, traced %.5f (%.5f); total %.5f, traced %.5f (%.5f)\n",
                    lights[l].theta_deg, direct, first, albedo * traced[l].orders[0].se, total,
                    traced[l].all.mean, traced[l].all.se);
        // 256 directions and 64 places leave a fifth of a percent.
        EXPECT_NEAR(direct, first, 3.5 * std::hypot(albedo * traced[l].orders[0].se, 0.002 * first));
        EXPECT_NEAR(total, traced[l].all.mean, 3.5 * std::hypot(traced[l].all.se, 0.002 * total));
    }
}

// Pixel by pixel, which facet a view shows: views are told in the frame of the pixel.
TEST_P(CurvedPictures, ViewsOfABtf) {
    const HeightField surface = relief_on(GetParam());
    BtfPlan plan;
    plan.incident = {{20, 0}};
    plan.outgoing = {{0, 0}, {30, 20}, {50, 250}, {60, 130}};
    plan.plane = BtfPlan::Plane::zero;
    plan.pixels_x = size;
    plan.pixels_y = 2 * size;  // no pixel's centre lies on the diagonal of a cell
    plan.max_order = 1;
    plan.accuracy.samples = Accuracy::Samples{1, 16, 1, 2};
    const Btf btf = measure_btf(surface, gray({0.5}), plan, {}).btf,
              flat = measure_btf(relief_on({}), gray({0.5}), plan, {}).btf;
    const auto patches = patches_of(surface);
    const int n = patches[0]->core(), rows = 2 * size;
    int wrong = 0, wrong_if_flat = 0;
    for (size_t v = 0; v < plan.outgoing.size(); ++v)
        for (int j = 0; j < rows; ++j)
            for (int i = 0; i < size; ++i) {
                const CurvedPatch& patch = *patches[j / 2 / n * (size / n) + i / n];
                CurvedPatch::Point hit;
                const bool seen = patch.see(i % n + 0.5, j / 2 % n + 0.25 + 0.5 * (j % 2),
                                            to_vector(plan.outgoing[v]), &hit);
                const size_t at = (v * rows + j) * size + i;
                wrong += !seen || hit.facet != btf.view_maps[at];
                wrong_if_flat += !seen || hit.facet != flat.view_maps[at];
            }
    std::printf("%d pixels of %zu differ, of a flat base %d\n", wrong, btf.view_maps.size(), wrong_if_flat);
    EXPECT_LT(wrong, static_cast<int>(btf.view_maps.size() / 80));
    EXPECT_GT(wrong_if_flat, 4 * wrong);
}

INSTANTIATE_TEST_SUITE_P(Bases, CurvedPictures,
                         ::testing::Values(BaseCurvature{1.0 / 60, 0, 0},
                                           BaseCurvature{1.0 / 60, 0, radians(30)},
                                           BaseCurvature{1.0 / 80, 1.0 / 80, 0},
                                           BaseCurvature{-1.0 / 200, 0, 0}));

// The mean of the pixels is the BRDF but for what the frames of a pixel and of the facet that it shows differ
// by, of first order in the curvature, which the biases hold.
TEST(CurvedBtf, HasTheBrdfAsItsMean) {
    const std::vector<AnglesDeg> lights{{0, 0}, {30, 40}, {60, 200}}, views{{0, 0}, {40, 20}, {60, 130}};
    for (const double kappa : {1.0 / 100, 1.0 / 400}) {
        const HeightField surface = relief_on({kappa, kappa, 0});
        BtfPlan plan;
        plan.incident = lights;
        plan.outgoing = views;
        plan.plane = BtfPlan::Plane::zero;
        plan.pixels_x = plan.pixels_y = 128;
        plan.pixel_samples = 2;
        plan.accuracy.samples = Accuracy::Samples{2, 256, 2, 6};
        const Btf btf = measure_btf(surface, gray({0.8}), plan, {}).btf;
        const Table brdf = measure(surface, gray({0.8}), plan_for_target(lights, views, 0.004)).table;
        for (size_t k = 0; k < brdf.f.size(); ++k) {
            std::printf("kappa %g row %zu: %+.2f %%, doubt %.2f %%\n", kappa, k,
                        100 * (btf.mean.f[k] / brdf.f[k] - 1),
                        100 * std::hypot(doubt(btf.mean, k), doubt(brdf, k)) / brdf.f[k]);
            EXPECT_NEAR(btf.mean.f[k] / brdf.f[k], 1,
                        3.5 * std::hypot(doubt(btf.mean, k), doubt(brdf, k)) / brdf.f[k]);
            EXPECT_LT(btf.mean.bias[k] / brdf.f[k], 0.003 + 2 * kappa) << "too cautious to be of use";
        }
    }
}

TEST(CurvedPicturesRefuse, WhatTheyCannotDo) {
    auto message = [&](auto&& what) {
        try {
            what();
        } catch (const Error& error) {
            return error.field() + ": " + error.what();
        }
        return std::string("nothing");
    };
    HeightField surface = relief_on({0.01, 0, 0});
    BtfPlan plan;
    plan.incident = {{0, 0}};
    plan.cameras = CameraPlane{1, 1, 1, 1, 100};
    EXPECT_NE(message([&] { measure_btf(surface, gray({0.5}), plan, {}); }).find("/base: "),
              std::string::npos);
    EXPECT_NE(message([&] { GlossyBtf(surface, gray({0.5}), plan, {}, {}); }).find("/base: "),
              std::string::npos);
    plan.cameras.reset();
    plan.outgoing = {{0, 0}};
    // A relief that does not fit on its base is refused by every measurement, by name.
    surface.base = {0, 0.24, 0};
    EXPECT_NE(message([&] { measure_btf(surface, gray({0.5}), plan, {}); }).find("/base/kappa_2"),
              std::string::npos);
    EXPECT_NE(message([&] { GlossyBtf(surface, gray({0.5}), plan, {}, {}); }).find("/base/kappa_2"),
              std::string::npos);
    MapsPlan maps;
    maps.incident = {{0, 0}};
    EXPECT_NE(message([&] { measure_maps(surface, gray({0.5}), maps, {}); }).find("/base/kappa_2"),
              std::string::npos);
    Environment environment;
    surface.base = {0.01, 0, 0};
    EXPECT_NE(message([&] {
                  measure_relight(surface, gray({0.5}), environment, RelightPlan{}, {});
              }).find("/base: "),
              std::string::npos);
}

}  // namespace
}  // namespace gonio
