// Maps against closed forms of planes and V-grooves, and their light against the BRDF.
#include "measure/maps.h"

#include <algorithm>

#include "agreement/measured.h"
#include "surface/generate.h"

namespace gonio {
namespace {

const MapLayer& layer(const Maps& maps, const std::string& name) {
    for (const MapLayer& one : maps.layers)
        if (one.name == name) return one;
    ADD_FAILURE() << "no layer " << name;
    return maps.layers.front();
}

MapsPlan maps_plan(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing,
                   Accuracy::Samples samples = {4, 64, 1, 4}) {
    MapsPlan plan;
    plan.incident = std::move(incident);
    plan.outgoing = std::move(outgoing);
    plan.accuracy.samples = samples;
    return plan;
}

TEST(Maps, OfAPlane) {
    const Maps maps =
        measure_maps(generate_plane(8, 1), gray({0.4}), maps_plan({{50, 20}}, {{70, 0}}), {}).maps;
    const auto expect = [&](const std::string& name, double value) {
        for (const float v : layer(maps, name).pixels) EXPECT_NEAR(v, value, 1e-5) << name;
    };
    expect("light000.direct.c0", 0.4);
    expect("light000.indirect.c0", 0);
    expect("light000.total.c0", 0.4);
    expect("light000.shadow", 1);
    expect("view000.mask", 1);
    expect("sky", 1);
    EXPECT_EQ(layer(maps, "sky").se, 0);
}

// V-groove of 45 degrees, P = 1, light from +x at 60 degrees: the wall that faces it is lit from its ridge at
// -1/2 down to x = -1/2 (1 - tan 30) / (1 + tan 30), the other not at all; lit, it receives cos(15) of the
// light, over cos(60) of the base.
TEST(Maps, OfAVGrooveShowItsShadowsAndItsSky) {
    const int n = 256;
    MapsPlan plan = maps_plan({{60, 0}}, {{60, 180}});
    plan.sky_directions = 1024;
    const Maps maps = measure_maps(generate_v_groove(n, 1, 45), gray({0.8}), plan, {}).maps;
    const double t = std::tan(radians(30)), edge = 1 - 0.5 * (1 - t) / (1 + t);  // columns run from 0 to 1
    for (int i = 0; i < n; ++i) {
        const double x = (i + 0.5) / n;
        const float lit = layer(maps, "light000.shadow").pixels[i],
                    seen = layer(maps, "view000.mask").pixels[n - 1 - i],
                    direct = layer(maps, "light000.direct.c0").pixels[i];
        if (std::abs(x - edge) < 2.0 / n || std::abs(x - 0.5) < 2.0 / n) continue;
        const bool expected = x > 0.5 && x < edge;
        EXPECT_NEAR(lit, expected ? 1 : 0, 1e-5) << i;
        EXPECT_NEAR(seen, expected ? 1 : 0, 1e-5) << i;
        EXPECT_NEAR(direct, expected ? 0.8 * std::cos(radians(15)) / std::cos(radians(60)) : 0, 1e-4);
    }
    // A wall sees the opening of the groove, width 1, by the crossed strings of Hottel: sin(45), whatever it
    // reflects.
    EXPECT_NEAR(layer(maps, "sky").mean, std::sin(radians(45)), 3e-3);
}

// The exitance of a map, seen from straight above over all azimuths and heights, is the albedo of the relief:
// here only its mean over the base plane, which from straight above is pi times the BRDF.
TEST(Maps, HaveTheBrdfFromAboveAsTheirMean) {
    const HeightField field = generate_gaussian(64, 64, 1, 8, 0.6, 5);
    const std::vector<AnglesDeg> lights = {{20, 0}, {60, 250}};
    MapsPlan plan = maps_plan(lights, {}, {4, 64, 2, 4});
    plan.sky_directions = 0;
    const Maps maps = measure_maps(field, gray({0.8, 0.3}), plan, {}).maps;
    BrdfPlan brdf = plan_for_target(lights, {{0, 0}}, 0.004);
    brdf.separate_orders = true;
    const Table table = measure(field, gray({0.8, 0.3}), brdf).table;
    for (size_t l = 0; l < lights.size(); ++l)
        for (size_t c = 0; c < 2; ++c) {
            const std::string light = "light00" + std::to_string(l) + ".", channel = ".c" + std::to_string(c);
            const double all = pi * table.f[table.index(c, 0, l)], first = pi * table.f[table.index(c, 1, l)];
            EXPECT_NEAR(layer(maps, light + "total" + channel).mean, all, 0.006 * all);
            EXPECT_NEAR(layer(maps, light + "direct" + channel).mean, first, 0.006 * first);
            EXPECT_NEAR(layer(maps, light + "indirect" + channel).mean, all - first, 0.06 * (all - first));
        }
}

// Where facets are not Lambertian the maps are of what arrives. A glossy lobe of no weight changes nothing
// but that, and who carries the light.
TEST(Maps, OfGlossyFacetsAreIrradiances) {
    const HeightField field = generate_gaussian(64, 64, 1, 8, 0.7, 11);
    MapsPlan plan = maps_plan({{30, 40}, {60, 200}}, {{45, 10}});
    plan.accuracy.samples = Accuracy::Samples{4, 256, 1, 4};
    const Material lambertian = gray({0.8});
    Material mixture = lambertian;
    Microfacet ggx;
    ggx.alpha_x = ggx.alpha_y = 0.3;
    mixture.lobes.push_back({0.0, ggx});
    const Maps sent = measure_maps(field, lambertian, plan, {}).maps;
    const MapsResult result = measure_maps(field, mixture, plan, {});
    const Maps& arrived = result.maps;
    EXPECT_EQ(result.report.settings.front().second, "pair graph");
    ASSERT_EQ(arrived.layers.size(), sent.layers.size());
    for (size_t k = 0; k < sent.layers.size(); ++k) {
        const MapLayer &a = arrived.layers[k], &b = sent.layers[k];
        EXPECT_EQ(a.name, b.name);
        const double albedo = a.name.find(".c0") == std::string::npos ? 1.0 : 0.8;
        double squares = 0;
        for (size_t p = 0; p < a.pixels.size(); ++p)
            squares += std::pow(albedo * a.pixels[p] - b.pixels[p], 2);
        const double rms = std::sqrt(squares / static_cast<double>(a.pixels.size()));
        EXPECT_LE(rms, 1.5 * std::hypot(albedo * a.se, b.se) + 1e-6) << a.name;
        EXPECT_NEAR(albedo * a.mean, b.mean, 0.01 * b.mean) << a.name;
    }
}

// No pair meets a lobe of alpha 1e-4, and all runs agree that nothing arrives: the error knows how much does.
// It is about what arrives over lobes of alpha 0.3, which pairs do meet.
TEST(Maps, KnowWhatNarrowLobesHide) {
    const auto indirect = [](double alpha, bool& warned) {
        Microfacet lobe;
        lobe.alpha_x = lobe.alpha_y = alpha;
        lobe.reflectance.reflectance = 1.0;
        const MapsResult found = measure_maps(generate_gaussian(64, 64, 1, 8, 0.7, 12), {{"y"}, lobe},
                                              maps_plan({{60, 200}}, {}, {1, 64, 1, 4}), {});
        warned =
            std::any_of(found.report.warnings.begin(), found.report.warnings.end(),
                        [](const std::string& text) { return text.find("narrower") != std::string::npos; });
        return layer(found.maps, "light000.indirect.y");
    };
    bool wide_warns = false, narrow_warns = false;
    const MapLayer wide = indirect(0.3, wide_warns), narrow = indirect(1e-4, narrow_warns);
    EXPECT_GT(narrow.se, 0.5 * wide.mean);
    EXPECT_LT(narrow.se, 2 * wide.mean);
    EXPECT_TRUE(narrow_warns);
    EXPECT_FALSE(wide_warns);
}

TEST(Maps, StateTheErrorOfAPixel) {
    const HeightField field = generate_gaussian(64, 64, 1, 8, 0.7, 5);
    MapsPlan plan = maps_plan({{50, 30}}, {}, {1, 32, 1, 6});
    plan.sky_directions = 0;
    const Maps a = measure_maps(field, gray({0.8}), plan, {}).maps;
    plan.accuracy.seed = 2;
    const Maps b = measure_maps(field, gray({0.8}), plan, {}).maps;
    const MapLayer &x = layer(a, "light000.total.c0"), &y = layer(b, "light000.total.c0");
    double squares = 0;
    for (size_t k = 0; k < x.pixels.size(); ++k) squares += std::pow(x.pixels[k] - y.pixels[k], 2);
    const double rms = std::sqrt(squares / static_cast<double>(x.pixels.size())),
                 stated = std::hypot(x.se, y.se);
    EXPECT_NEAR(rms, stated, 0.2 * stated);
}

}  // namespace
}  // namespace gonio
