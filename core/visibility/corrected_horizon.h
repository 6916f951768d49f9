// Shadows on a curved base from the horizons of a flat one (Onoue, Max, Nishita 2004): where
// BaseCurvature::corrects_horizons.
#pragma once
#include <cstdint>

#include "visibility/march.h"

namespace gonio {

// As march_visible, for the points `start` of the cells: bit set if the direction stands above the corrected
// horizon. A facet's own front is not looked at: where it faces away, its cosine says so.
void corrected_visible(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                       const CellRect& rect, uint32_t* visible);

// All rays of a direction as the base asks for: bent, or by corrected horizons. Returns whether a bundle was
// truncated.
bool visible_on_base(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start, double max_travel,
                     const CellRect& rect, uint32_t* visible);

}  // namespace gonio
