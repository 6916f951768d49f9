// The reliefs and the facets that every transport is tried on: small enough for the path tracer to judge each
// pair of them in a fraction of a second.
#pragma once
#include <algorithm>
#include <string>
#include <vector>

#include "material/metals.h"
#include "surface/generate.h"
#include "surface/prepare.h"

namespace gonio::standard {

struct Relief {
    const char* name;
    HeightField (*make)();
};

// A sample of tests/samples, or the part `crop` of it, averaged to n x n nodes.
inline HeightField sample(const char* file, double width, double height_range, int n,
                          Boundary boundary = Boundary::periodic) {
    PrepareOptions options;
    options.width = width;
    options.height_range = height_range;
    options.resample = {n, n};
    options.boundary = boundary;
    return prepare_surface(read_heights(std::string(GONIO_TEST_DATA "/samples/") + file), options).surface;
}

// Flat but for a terrace, a spike and a hole of one node each: walls as steep as the grid can have.
inline HeightField terrace() {
    constexpr int nx = 20, ny = 16;
    std::vector<double> heights(nx * ny, 0.0);
    for (int j = 4; j < 11; ++j)
        for (int i = 3; i < 12; ++i) heights[j * nx + i] = 2.5e-6;
    heights[8 * nx + 16] = 4e-6;
    heights[13 * nx + 6] = -3e-6;
    return make_height_field(nx, ny, 1e-6, 1e-6, heights);
}

inline HeightField oblong() {
    HeightField surface = generate_gaussian(24, 32, 1e-6, 5e-6, 0.7, 33);
    surface.pitch_y *= 1.7;
    return surface;
}

// Slopes of the Gaussian fields: rms 0.3 and 0.7.
inline const std::vector<Relief> reliefs{
    {"plane", [] { return generate_plane(4, 1e-6); }},
    {"v_groove", [] { return generate_v_groove(16, 16e-6, 45); }},
    {"gaussian_03", [] { return generate_gaussian(32, 32, 1e-6, 5e-6, 0.3, 31); }},
    {"gaussian_07", [] { return generate_gaussian(32, 32, 1e-6, 5e-6, 0.7, 32); }},
    {"lava_rock", [] { return sample("lava_rock_256_16bit.png", 50e-3, 10e-3, 32); }},
    {"terrace", terrace},
    {"oblong_pitch", oblong},
    {"mirrored", [] { return sample("wool_256_8bit.png", 40e-3, 16e-3, 16, Boundary::mirror); }},
    {"open", [] { return sample("lava_rock_256_16bit.png", 50e-3, 6e-3, 32, Boundary::open); }}};

struct Facets {
    const char* name;
    Material (*make)(int nx, int ny);  // of the relief, for maps
};

inline Lobe rough(Microfacet::Distribution distribution, double alpha_x, double alpha_y, double rotation_deg,
                  SpecularReflectance reflectance) {
    return Microfacet{distribution, alpha_x, alpha_y, rotation_deg, std::move(reflectance)};
}

inline SpecularReflectance metal(Metal which) {
    SpecularReflectance reflectance;
    for (const ComplexIndex& index : metal_index_rgb(which)) {
        reflectance.eta.constant.push_back(index.eta);
        reflectance.k.constant.push_back(index.k);
    }
    return reflectance;
}

// No two neighbours alike, and no symmetry between x and y.
inline Parameter patchwork(int nx, int ny, double low, double high) {
    std::vector<float> values;
    for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i)
            values.push_back(static_cast<float>(low + (high - low) * ((3 * i + 5 * j) % 7) / 6));
    return Parameter::mapped(nx, ny, std::move(values));
}

inline const std::vector<Facets> materials{
    {"lambertian",
     [](int, int) {
         return Material({"r", "g"}, Lambertian{{0.8, 0.3}});
     }},
    {"lambertian_map", [](int nx, int ny) { return Material({"y"}, Lambertian{patchwork(nx, ny, 0.2, 1)}); }},
    {"phong",
     [](int, int) {
         return Material({"y"}, Phong{20.0, 0.9});
     }},
    {"blinn_phong",
     [](int, int) {
         return Material({"y"}, BlinnPhong{12.0, 0.8});
     }},
    {"ggx_copper",
     [](int, int) {
         return Material({"r", "g", "b"},
                         rough(Microfacet::Distribution::ggx, 0.3, 0.3, 0, metal(Metal::cu)));
     }},
    {"ggx_brushed",
     [](int, int) {
         return Material({"y"}, rough(Microfacet::Distribution::ggx, 0.25, 0.5, 35, {0.9, {}, {}}));
     }},
    {"beckmann_iron",
     [](int, int) {
         return Material({"r", "g", "b"},
                         rough(Microfacet::Distribution::beckmann, 0.35, 0.35, 0, metal(Metal::fe)));
     }},
    {"coated_diffuse",
     [](int, int) {
         return Material({"y"}, CoatedDiffuse{1.5, 0.3, 0.8});
     }},
    {"mirror",
     [](int, int) {
         return Material({"r", "g", "b"}, Mirror{metal(Metal::au)});
     }},
    {"mixture",
     [](int, int) {
         Material material({"r", "g"}, Lambertian{{0.9, 0.4}});
         material.lobes.front().weight = 0.5;
         material.lobes.push_back({0.5, rough(Microfacet::Distribution::ggx, 0.3, 0.3, 0, {1.0, {}, {}})});
         return material;
     }},
    {"half_mirror",
     [](int, int) {
         Material material({"y"}, Mirror{{0.9, {}, {}}});
         material.lobes.front().weight = 0.4;
         material.lobes.push_back({0.6, Lambertian{0.7}});
         return material;
     }},
    {"mixture_map", [](int nx, int ny) {
         Material material({"y"}, Lambertian{0.6});
         material.lobes.front().weight = patchwork(nx, ny, 0.1, 0.7);
         material.lobes.push_back({0.3, Microfacet{Microfacet::Distribution::beckmann,
                                                   patchwork(nx, ny, 0.5, 0.25),
                                                   0.3,
                                                   patchwork(nx, ny, -40, 80),
                                                   {0.9, {}, {}}}});
         return material;
     }}};

}  // namespace gonio::standard
