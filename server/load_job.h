// From a parsed job to what is simulated: opens and prepares the files it names.
#pragma once
#include <string>
#include <vector>

#include "server/job.h"
#include "surface/statistics.h"

namespace gonio {

struct LoadedSurface {
    HeightField surface;
    int stored_nx = 0, stored_ny = 0;  // before crop, resample and mirror; 0 for generated surfaces
    SurfaceStatistics statistics;
    std::string hash;                // surface_hash
    std::string description;         // "lava.png, 1024 x 1024 points", "generated v_groove, 128 x 1 points"
    std::vector<std::string> notes;  // what was done to it
    std::vector<std::string> warnings;  // what the user should look at
};

// Throws Error: not_found and io with the file's name, invalid_input and missing_unit with a path under
// "/surface", or "/base" if the relief does not fit on that base.
LoadedSurface load_surface(const SurfaceSource& source, const BaseCurvature& base = {});

// The material with its maps, if it has any, read and registered to the surface: a map has the size of the
// stored surface and goes through the same y_axis, crop, resample and boundary. Integer images are normalised
// by their largest value, floating-point ones taken as they are. Throws Error whose field is the map's, under
// "/material", for another size or values that are not allowed.
Material load_material(const MaterialSource& material, const SurfaceSource& source,
                       const LoadedSurface& surface);

// The environment with its map, if it has one, read. Throws Error with the file's name, or under
// "/environment".
Environment load_environment(const EnvironmentSource& source);
// SHA-256 (hex) of its radiances and where they stand.
std::string environment_hash(const Environment& environment);

}  // namespace gonio
