// Where the rays of a bundle hit, in the numbering of a tile.
#pragma once
#include "scattering/tile.h"
#include "visibility/crossings.h"

namespace gonio {

inline int into_period(int i, int n) {
    return i >= 0 && i < n ? i : wrap_index(i, n);
}

// Column and row of the hit cell inside the tile, or false if the ray has left the tile.
inline bool hit_cell(const Tile& tile, int column, int row, int& hit_column, int& hit_row) {
    hit_column = into_period(column, tile.nx);
    hit_row = into_period(row, tile.ny);
    return hit_column < tile.area.width && hit_row < tile.area.height;
}

// The facet part that is hit by the ray from cell (cell_x, cell_y) of the surface, from the two crossings
// that bracket the hit; k is the crossing behind it, kind the kind of the facet hit.
int hit_part(const MarchGrid& grid, const RayBundle& rays, int cell_x, int cell_y, int k, int refinement,
             int kind);

}  // namespace gonio
