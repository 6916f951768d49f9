// Exact reductions of a job before any work is done: what a scene does not need is not computed (design 3.4).
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "material/material.h"
#include "surface/height_field.h"

namespace gonio {

struct SimplifiedScene {
    HeightField surface;
    Material material;
    bool axes_swapped =
        false;  // x and y exchanged: directions must be, too (an exact symmetry of the triangulation)
    std::vector<std::pair<std::string, std::string>> skipped;
};

bool has_maps(const Material& material);

// A surface that is invariant along an axis becomes one row; a surface of one column becomes one row by
// exchanging the axes, so that rays still march 16 at a time. allow_skips = false: only the exchange.
SimplifiedScene simplify_scene(const HeightField& surface, const Material& material, bool allow_skips);

// Largest |difference of heights| over the pitch between neighbouring nodes is 0: a plane.
bool is_plane(const HeightField& surface);

}  // namespace gonio
