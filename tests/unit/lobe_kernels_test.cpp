// The batch kernels of the glossy engine against the facet material that all tests are held against.
#include "scattering/lobe_kernels.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "base/random.h"
#include "material/facet_brdf.h"
#include "scattering/glossy_direct.h"
#include "surface/generate.h"
#include "visibility/march.h"

namespace gonio {
namespace {

Microfacet microfacet(Microfacet::Distribution distribution, Parameter alpha_x, Parameter alpha_y) {
    Microfacet m;
    m.distribution = distribution;
    m.alpha_x = std::move(alpha_x);
    m.alpha_y = std::move(alpha_y);
    m.reflectance.reflectance = 0.9;
    return m;
}

Parameter random_map(int nx, int ny, double low, double high) {
    std::vector<float> values;
    for (int k = 0; k < nx * ny; ++k)
        values.push_back(static_cast<float>(low + (high - low) * uniform_double(random_words(5, 1, k)[0])));
    return Parameter::mapped(nx, ny, values);
}

struct NamedMaterial {
    std::string name;
    Material material;
};

std::vector<NamedMaterial> materials(int nx, int ny) {
    using enum Microfacet::Distribution;
    std::vector<NamedMaterial> list;
    auto add = [&](const char* name, Lobe lobe) { list.push_back({name, Material({"y"}, std::move(lobe))}); };
    add("lambertian", Lambertian{0.7});
    add("ggx", microfacet(ggx, 0.3, 0.3));
    add("ggx narrow", microfacet(ggx, 0.08, 0.08));
    add("ggx widest", microfacet(ggx, 1.0, 1.0));
    add("beckmann", microfacet(beckmann, 0.25, 0.25));
    for (const auto distribution : {ggx, beckmann}) {
        Microfacet turned = microfacet(distribution, 0.15, 0.5);
        turned.rotation_deg = 30.0;
        add("anisotropic", turned);
    }
    Microfacet metal = microfacet(ggx, 0.2, 0.2);
    metal.reflectance.eta = 0.27;
    metal.reflectance.k = 2.8;
    add("metal", metal);
    metal.reflectance.eta = random_map(nx, ny, 0.2, 1.5);
    add("metals", metal);
    Microfacet mapped = microfacet(beckmann, random_map(nx, ny, 0.1, 0.6), random_map(nx, ny, 0.2, 0.9));
    mapped.rotation_deg = random_map(nx, ny, -90, 90);
    add("maps", mapped);
    add("blinn_phong", BlinnPhong{40.0, 0.6});
    add("phong", Phong{25.0, 0.6});
    add("phong of exponent 0", Phong{0.0, 0.6});
    add("coated", CoatedDiffuse{1.5, 0.2, 0.5});
    add("coats", CoatedDiffuse{random_map(nx, ny, 1, 4), random_map(nx, ny, 0.02, 1), 0.5});
    add("coat of index 1e4", CoatedDiffuse{1e4, 0.3, 0.5});
    Material mixture({"y"}, Lambertian{0.8});
    mixture.lobes.front().weight = 0.5;
    mixture.lobes.push_back({random_map(nx, ny, 0, 0.5), microfacet(ggx, 0.2, 0.2)});
    list.push_back({"mixture", mixture});
    return list;
}

// Directions over the sphere; those below a facet are compared with nothing.
std::vector<Vec3> directions(int n, uint64_t stream) {
    std::vector<Vec3> list;
    for (int k = 0; k < n; ++k) {
        const auto words = random_words(7, stream, k);
        const double z = 1 - 1.3 * uniform_double(words[0]), phi = 2 * pi * uniform_double(words[1]),
                     r = std::sqrt(1 - z * z);
        list.push_back({r * std::cos(phi), r * std::sin(phi), z});
    }
    return list;
}

class LobeKernels : public testing::TestWithParam<const char*> {
  protected:
    void SetUp() override {
        if (!force_simd_target(GetParam())) GTEST_SKIP() << GetParam() << " is not here";
    }
    void TearDown() override { force_simd_target(""); }
};

TEST_P(LobeKernels, RowsAreTheMaterial) {
    const HeightField surface = generate_gaussian(40, 12, 1, 3, 0.6, 3);
    const Tile tile = make_tile(surface, {0, 0, 40, 12}, {0, 0, 40, 12}, 1);
    const std::vector<Vec3> seen = directions(21, 1), own = directions(1, 2);
    const DirectionArrays arrays(seen);
    for (const auto& [name, material] : materials(40, 12)) {
        const SlotMaterial slots = slot_material(material, surface, tile, 0);
        int compared = 0;
        for (int kind = 0; kind < 2; ++kind)
            for (int j = 0; j < 12; j += 3)
                for (int i = 0; i < 40; i += 7) {
                    const uint32_t slot = static_cast<uint32_t>(tile.slot(kind, j, i));
                    const auto x = static_cast<float>(own[0].x), y = static_cast<float>(own[0].y),
                               z = static_cast<float>(own[0].z);
                    std::vector<float> row(arrays.padded());
                    lobe_rows(slots, tile, 1, &slot, &x, &y, &z, arrays, row.data());
                    const FacetBrdf facet(material, surface, kind, i, j);
                    for (size_t c = 0; c < seen.size(); ++c) {
                        double f = 0;
                        facet.eval(own[0], seen[c], {&f, 1});
                        ASSERT_TRUE(std::isfinite(row[c])) << name;
                        if (dot(facet.normal(), own[0]) < 1e-3 || dot(facet.normal(), seen[c]) < 1e-3)
                            continue;
                        EXPECT_NEAR(row[c], f, 2e-4 * f + 1e-6)
                            << name << " slot " << slot << " column " << c;
                        ++compared;
                    }
                }
        EXPECT_GT(compared, 100) << name;
    }
}

TEST_P(LobeKernels, DirectSumsAreTheMaterialTimesWhatBothSee) {
    const HeightField surface = generate_gaussian(40, 8, 1, 2, 0.6, 3);
    const Tile tile = make_tile(surface, {0, 0, 40, 8}, {8, 1, 20, 4}, 1);
    const MarchGrid grid = make_march_grid(surface);
    std::vector<Vec3> lights = directions(5, 3), views = directions(3, 4);
    for (auto* list : {&lights, &views})
        for (Vec3& d : *list) d.z = std::abs(d.z);
    const std::vector<SubSample> places{{0.1, 0.7}, {0.8, 0.3}, {0.45, 0.55}};
    for (const int n_samples : {1, 3}) {
        const std::vector<SubSample> samples(places.begin(), places.begin() + n_samples);
        const VisibilityBits light_bits = find_visibility(grid, tile, lights, samples, true, 1, {}),
                             view_bits = find_visibility(grid, tile, views, samples, true, 1, {});
        for (const auto& [name, material] : materials(40, 8)) {
            const SlotMaterial slots = slot_material(material, surface, tile, 0);
            for (const bool same : {false, true}) {
                const auto& others = same ? lights : views;
                const VisibilityBits& other_bits = same ? light_bits : view_bits;
                Matrix sums(static_cast<int>(lights.size()), static_cast<int>(others.size())),
                    expected = sums;
                add_direct(slots, tile, DirectionArrays(lights), DirectionArrays(others), same, light_bits,
                           view_bits, 1.0 / n_samples, 2, {}, sums);
                for (int kind = 0; kind < 2; ++kind)
                    for (int j = 1; j < 5; ++j)
                        for (int i = 8; i < 28; ++i) {
                            const size_t slot = tile.slot(kind, j, i);
                            const FacetBrdf facet(material, surface, kind, i, j);
                            const double area = 0.5 / facet.normal().z;
                            for (int l = 0; l < sums.rows; ++l)
                                for (int v = 0; v < sums.columns; ++v) {
                                    double f = 0;
                                    facet.eval(lights[l], others[v], {&f, 1});
                                    expected(l, v) +=
                                        area * f * std::max(0.0, dot(facet.normal(), lights[l])) *
                                        std::max(0.0, dot(facet.normal(), others[v])) / n_samples *
                                        std::popcount(light_bits.of(l)[slot] & other_bits.of(v)[slot]);
                                }
                        }
                for (int l = 0; l < sums.rows; ++l)
                    for (int v = 0; v < sums.columns; ++v)
                        EXPECT_NEAR(sums(l, v), expected(l, v), 1e-4 * expected(l, v) + 1e-6)
                            << name << same << n_samples;
            }
        }
    }
}

INSTANTIATE_TEST_SUITE_P(EveryTarget, LobeKernels, testing::Values("", "AVX2", "SSE4"),
                         [](const auto& target) {
                             const std::string name = target.param;
                             return name.empty() ? std::string("Best") : name;
                         });

TEST(ChannelGroups, ChannelsInProportionShareOneTransport) {
    Microfacet metal = microfacet(Microfacet::Distribution::ggx, 0.3, 0.3);
    metal.reflectance.reflectance = {0.8, 0.4, 0.0};
    const Material colour({"r", "g", "b"}, metal);
    ASSERT_EQ(channel_groups(colour).size(), 1u);
    EXPECT_EQ(channel_groups(colour)[0].scale, (std::vector<double>{1, 0.5, 0}));
    // A gray part beside a coloured one: every channel on its own.
    Material mixture = colour;
    mixture.lobes.front().weight = 0.5;
    mixture.lobes.push_back({0.5, Lambertian{0.5}});
    EXPECT_EQ(channel_groups(mixture).size(), 3u);
    // Fresnel's factor changes its shape with the index.
    metal.reflectance.eta = {0.2, 0.2, 1.1};
    metal.reflectance.k = {3.9, 3.9, 2.6};
    const auto groups = channel_groups(Material({"r", "g", "b"}, metal));
    ASSERT_EQ(groups.size(), 2u);
    EXPECT_EQ(groups[0].channels, (std::vector<size_t>{0, 1}));
}

}  // namespace
}  // namespace gonio
