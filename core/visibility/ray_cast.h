// One ray that shares its direction with no other, as those of a camera close by: the plain counterpart of
// the lockstep march.
#pragma once
#include <cstdint>
#include <optional>

#include "visibility/march_grid.h"

namespace gonio {

// facet_index() (view_map.h) of the facet part that a falling ray meets first; nothing if it is so nearly
// horizontal that it was given up. x, y: where it passes the highest point of the relief, in cells of any
// period; direction.rise < 0.
std::optional<uint32_t> cast_from_above(const MarchGrid& grid, double x, double y,
                                        const MarchDirection& direction, int refinement);

}  // namespace gonio
