// What BTFs and maps have in common that their means do not show: where pixels and cameras stand, both kinds
// of facets, both axes, maps of each channel.
#include "agreement/measured.h"
#include "base/half.h"
#include "measure/btf.h"
#include "measure/btf_views.h"
#include "measure/maps.h"
#include "surface/generate.h"

namespace gonio {
namespace {

BtfPlan btf_plan(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing) {
    BtfPlan plan;
    plan.incident = std::move(incident);
    plan.outgoing = std::move(outgoing);
    plan.accuracy.samples = Accuracy::Samples{1, 64, 1, 4};
    return plan;
}

const MapLayer& layer(const Maps& maps, const std::string& name) {
    for (const MapLayer& one : maps.layers)
        if (one.name == name) return one;
    ADD_FAILURE() << "no layer " << name;
    return maps.layers.front();
}

// A striped table two cells high, seen at 45 degrees: its image at height 0 is that of its top, two pixels
// farther.
TEST(Pictures, PixelsLieAtTheTopOrAtHeightZero) {
    constexpr int n = 8;
    const HeightField table = make_height_field(n, n, 1, 1, std::vector<double>(n * n, 2.0));
    std::vector<float> stripes;
    for (int k = 0; k < n * n; ++k) stripes.push_back(0.1f * static_cast<float>(k % n));
    const Material material{{"y"}, Lambertian{Parameter::mapped(n, n, stripes)}};
    BtfPlan plan = btf_plan({{0, 0}}, {{45, 0}});
    const auto image = [&](BtfPlan::Plane plane) {
        plan.plane = plane;
        const Btf btf = measure_btf(table, material, plan, {}).btf;
        std::vector<uint16_t> pixels(btf.shape.images_size());
        expand_view(btf.shape, btf.radiance, btf.view_maps, 0, pixels);
        return pixels;
    };
    const std::vector<uint16_t> top = image(BtfPlan::Plane::top), zero = image(BtfPlan::Plane::zero);
    for (int i = 0; i < n; ++i) {
        EXPECT_NEAR(from_half_bits(top[i]), 0.1 * i / pi, 2e-4);
        EXPECT_NEAR(from_half_bits(zero[i]), 0.1 * ((i + 2) % n) / pi, 2e-4);
    }
}

// In the middles of equal parts of their plane, above the middle of the surface.
TEST(Pictures, CamerasStandInTheMiddlesOfTheirPlane) {
    const HeightField surface = generate_egg_crate(8, 8, 0.5);
    BtfPlan plan;
    plan.cameras = CameraPlane{};
    plan.cameras->n_u = 2, plan.cameras->n_v = 3;
    plan.cameras->width = 4, plan.cameras->depth = 6, plan.cameras->height = 10;
    const std::vector<Vec3> places = camera_places(surface, plan);
    ASSERT_EQ(places.size(), 6u);
    for (int v = 0; v < 3; ++v)
        for (int u = 0; u < 2; ++u) {
            EXPECT_NEAR(places[2 * v + u].x, 4 + (u == 0 ? -1 : 1), 1e-12);
            EXPECT_NEAR(places[2 * v + u].y, 4 + 2 * (v - 1), 1e-12);
            EXPECT_NEAR(places[2 * v + u].z, 11, 1e-6);
        }
}

TEST(Pictures, ShowBothKindsOfFacetsEqually) {
    const HeightField surface = generate_gaussian(24, 24, 1, 5, 0.5, 3);
    for (const int samples : {2, 4, 8}) {
        BtfPlan plan = btf_plan({{30, 0}}, {{0, 0}});
        plan.pixel_samples = samples;
        const Btf btf = measure_btf(surface, gray({0.5}), plan, {}).btf;
        size_t lower = 0;
        for (const uint32_t facet : btf.view_maps) lower += facet / (24 * 24) % 2 == 0;
        EXPECT_EQ(2 * lower, btf.view_maps.size()) << samples;
    }
}

// Albedos as maps that are the same everywhere, one a channel: what numbers give, through all orders.
TEST(Pictures, MapsOfEachChannelAreItsOwn) {
    const HeightField surface = generate_gaussian(24, 24, 1, 5, 0.9, 3);
    std::vector<float> planes(2 * 24 * 24, 0.9f);
    std::fill(planes.begin() + 24 * 24, planes.end(), 0.2f);
    const Material mapped{{"c0", "c1"}, Lambertian{Parameter::mapped(24, 24, planes)}};
    const BtfPlan plan = btf_plan({{30, 0}, {60, 100}}, {{0, 0}, {50, 30}});
    expect_tables_near(measure_btf(surface, mapped, plan, {}).btf.mean,
                       measure_btf(surface, gray({0.9, 0.2}), plan, {}).btf.mean, 1e-3);
}

// A groove along x is one along y, turned.
TEST(Pictures, ShadowsAlongBothAxes) {
    const HeightField along_y = generate_v_groove(64, 1, 45);
    HeightField along_x = along_y;
    along_x.nx = 1, along_x.ny = along_y.nx;
    const auto maps_of = [](const HeightField& surface, double turn_deg) {
        MapsPlan plan;
        plan.incident = {{60, turn_deg}, {30, turn_deg}};
        plan.sky_directions = 0;
        plan.accuracy.samples = Accuracy::Samples{4, 64, 1, 2};
        return measure_maps(surface, gray({0.8}), plan, {}).maps;
    };
    const Maps a = maps_of(along_y, 0), b = maps_of(along_x, 90);
    for (const char* name : {"light000.shadow", "light001.shadow"}) {
        EXPECT_NEAR(layer(a, name).mean, layer(b, name).mean, 0.02);
        EXPECT_GT(layer(b, name).mean, 0.1);
    }
}

// Few directions of the sky: how far the map is from one of many is what it says.
TEST(Pictures, TheSkyKnowsItsError) {
    const HeightField surface = generate_gaussian(32, 32, 1, 5, 0.8, 7);
    const auto sky_of = [&](int directions, int replicates) {
        MapsPlan plan;
        plan.incident = {{0, 0}};
        plan.sky_directions = directions;
        plan.accuracy.samples = Accuracy::Samples{1, 64, 1, replicates};
        return layer(measure_maps(surface, gray({0.8}), plan, {}).maps, "sky");
    };
    const MapLayer few = sky_of(16, 6), many = sky_of(512, 8);
    double squares = 0;
    for (size_t k = 0; k < few.pixels.size(); ++k) squares += std::pow(few.pixels[k] - many.pixels[k], 2);
    const double rms = std::sqrt(squares / static_cast<double>(few.pixels.size()));
    EXPECT_LT(rms, 1.5 * std::hypot(few.se, many.se));
    EXPECT_GT(rms, 0.5 * std::hypot(few.se, many.se));
}

}  // namespace
}  // namespace gonio
