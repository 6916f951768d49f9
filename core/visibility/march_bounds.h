// What decides which rays can hit anything, without the planes that tell which do.
#pragma once
#include "visibility/march_grid.h"

namespace gonio {

// make_march_grid(surface) with `rows` and `transposed` left empty.
MarchGrid march_bounds(const HeightField& surface);

}  // namespace gonio
