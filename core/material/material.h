// Reflectance of the facets: a closed variant. A new reflectance is one struct here, one file, one entry in the variant.
#pragma once
#include <string>
#include <variant>
#include <vector>

namespace gonio {

// f_micro = albedo / pi. A spectrum is a list of channels; a map gives each cell of the grid its own albedo.
struct Lambertian {
    std::vector<double> albedo;  // one a channel, each in [0, 1]; empty if `map` is used
    // Registered to the grid: cell (i, j) of the (prepared) surface has map[(c * map_ny + j) * map_nx + i]; values in [0, 1].
    int map_nx = 0, map_ny = 0;
    std::vector<float> map;
    bool is_map() const { return !map.empty(); }
};

struct Material {
    std::vector<std::string> channels;  // "y", or "r" "g" "b", or "450nm" ...
    std::variant<Lambertian> reflectance;
};

// Throws Error("/material/...") for albedos outside [0, 1], NaN, or a map of another size than nx x ny.
void validate(const Material& material, int nx, int ny);

}  // namespace gonio
