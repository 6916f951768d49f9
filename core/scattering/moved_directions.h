// Scattering on a curved base by what a flat one shows (Heidrich et al. 2000, sec. 5): two points that see
// each other still do, but the direction between them has moved, by their distance, their heights and the
// curvature.
#pragma once
#include "scattering/link_operator.h"

namespace gonio {

// Weighs the links of an operator that was traced over the flat relief (chunk.origins): cosines of the moved
// directions, and as solid angle that of the direction times the growth of the triangle fan around it among
// the directions of its facet. Directions that meet nothing stay, but for those beside others that do: the
// horizon moves as a whole. Where fans fold over, which is where
// visibility should have changed, they count as nothing.
void weigh_moved_directions(const MarchGrid& grid, const Tile& tile, const DirectionSet& set, int n_threads,
                            LinkOperator& op);

}  // namespace gonio
