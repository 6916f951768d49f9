// The reliefs and the table by which the stated errors are judged where no closed form is known.
#pragma once
#include <stdexcept>
#include <string>
#include <vector>

#include "directions/cells.h"
#include "directions/gonio_grid.h"
#include "measure/brdf.h"
#include "surface/generate.h"
#include "surface/prepare.h"

namespace gonio::honest {

struct Relief {
    const char* name;
    // The guess of the mesh bias and what its correction leaves (measure/mesh_bias.cpp) were measured on
    // these; the others were made afterwards, to judge them.
    bool seen_before;
    HeightField (*make)();
};

inline HeightField sample(const char* file, double width, double height_range) {
    PrepareOptions options;
    options.width = width;
    options.height_range = height_range;
    options.resample = {64, 64};
    return prepare_surface(read_heights(std::string(GONIO_TEST_DATA "/samples/") + file), options).surface;
}

// 64 x 64 nodes of pitch 1 (egg crate: 32 x 32); correlation length in cells, rms slope, seed.
inline const std::vector<Relief> reliefs{
    {"gentle", true, [] { return generate_gaussian(64, 64, 1, 8, 0.3, 11); }},
    {"rough", true, [] { return generate_gaussian(64, 64, 1, 8, 0.7, 12); }},
    {"very_rough", true, [] { return generate_gaussian(64, 64, 1, 8, 1.5, 13); }},
    {"fine_grained", true, [] { return generate_gaussian(64, 64, 1, 2, 0.7, 14); }},
    {"hilly", true, [] { return generate_gaussian(64, 64, 1, 4, 1.0, 21); }},
    {"wavy", true, [] { return generate_gaussian(64, 64, 1, 12, 0.5, 22); }},
    {"sandy", true, [] { return generate_gaussian(64, 64, 1, 1.5, 0.4, 23); }},
    {"alpine", true, [] { return generate_gaussian(64, 64, 1, 6, 2.0, 24); }},
    {"egg_crate", true, [] { return generate_egg_crate(32, 32, 5); }},
    {"lava_rock", true, [] { return sample("lava_rock_256_16bit.png", 50e-3, 10e-3); }},
    {"wool", true, [] { return sample("wool_256_8bit.png", 40e-3, 4e-3); }},
    {"tiles", true, [] { return sample("tiles_256_8bit.png", 1, 60e-3); }},
    {"dunes", false, [] { return generate_gaussian(64, 64, 1, 5, 0.9, 41); }},
    {"crags", false, [] { return generate_gaussian(64, 64, 1, 4, 1.6, 42); }},
    {"velvet", false, [] { return generate_gaussian(64, 64, 1, 2.5, 0.5, 43); }}};

inline const Relief& relief(const std::string& name) {
    for (const Relief& r : reliefs)
        if (name == r.name) return r;
    throw std::runtime_error("no relief " + name);
}

inline constexpr double albedo = 0.8;

inline Lobe microfacets(Microfacet::Distribution distribution, double alpha_x, double alpha_y) {
    Microfacet m;
    m.distribution = distribution;
    m.alpha_x = alpha_x;
    m.alpha_y = alpha_y;
    m.rotation_deg = 25.0;
    m.reflectance.reflectance = 1.0;
    return m;
}

struct Facets {
    const char* name;
    Material material;
};

inline const std::vector<Facets> facets{
    {"lambertian", {{"y"}, Lambertian{albedo}}},
    {"ggx_0.3", {{"y"}, microfacets(Microfacet::Distribution::ggx, 0.3, 0.3)}},
    {"ggx_0.15", {{"y"}, microfacets(Microfacet::Distribution::ggx, 0.15, 0.15)}},
    {"brushed", {{"y"}, microfacets(Microfacet::Distribution::beckmann, 0.3, 0.6)}},
    {"mixture",
     [] {
         Material mixture({"y"}, Lambertian{1.0});
         mixture.lobes.front().weight = 0.5;
         mixture.lobes.push_back({0.5, microfacets(Microfacet::Distribution::ggx, 0.2, 0.2)});
         return mixture;
     }()},
    {"phong", {{"y"}, Phong{20.0, 0.9}}},
    {"coated", {{"y"}, CoatedDiffuse{1.5, 0.3, 0.8}}}};

inline const Material& material(const std::string& name = "lambertian") {
    for (const Facets& f : facets)
        if (name == f.name) return f.material;
    throw std::runtime_error("no facets " + name);
}

// Reliefs with glossy facets that have a truth.
inline const std::vector<std::pair<const char*, const char*>> glossy{
    {"rough", "ggx_0.3"}, {"wavy", "ggx_0.15"},   {"hilly", "mixture"}, {"wavy", "brushed"},
    {"rough", "coated"},  {"egg_crate", "phong"}, {"dunes", "ggx_0.3"}};

// The same for receiver cells.
inline const std::vector<std::pair<const char*, const char*>> in_cells{
    {"rough", "lambertian"}, {"hilly", "mixture"}, {"dunes", "ggx_0.3"}};

enum class Receivers { directions, cells };

// Where the truth of a relief with such facets is kept, without its ending.
inline std::string truth_file(const std::string& relief, const std::string& facets_name = "lambertian",
                              Receivers receivers = Receivers::directions) {
    return "honest_" + relief + (facets_name == "lambertian" ? "" : "_" + facets_name) +
           (receivers == Receivers::cells ? "_cells" : "");
}

// 16 lights over the hemisphere, 16 views to 80 degrees: no two directions alike, so no two values are.
inline BrdfPlan plan() {
    BrdfPlan plan;
    plan.incident = equal_projected_hemisphere(16);
    plan.outgoing = product_grid({15, 40, 65, 80}, {20, 110, 200, 290});
    return plan;
}

// The same lights, 16 cells.
inline BrdfPlan cell_plan() {
    BrdfPlan plan = honest::plan();
    plan.outgoing_cells = equal_cells(16);
    plan.outgoing = centres(plan.outgoing_cells);
    return plan;
}

}  // namespace gonio::honest
