// The relief laid out for the lockstep march: heights in cells, padded so that 32 neighbouring rays are one
// contiguous load whatever the shift, once row by row and once transposed, with sliding-window maxima for
// skipping.
#pragma once
#include <vector>

#include "directions/direction.h"
#include "surface/height_field.h"

namespace gonio {

inline constexpr int march_block = 32;  // columns that march together; tiles are padded to a multiple of it

// One orientation. Heights are in units of pitch_x; a step of one column or one row is one cell.
struct MarchPlane {
    int nx = 0, ny = 0;
    int stride = 0;              // floats from row to row
    std::vector<float> heights;  // (ny + 2) * stride; column c holds node c mod nx, row r node row r mod ny
    // window_max[w][r * stride + c]: highest node of the square [c, c + window_size[w]] x [r, r +
    // window_size[w]]. A sliding window and not a decimated pyramid: loads stay contiguous and rays in
    // lockstep.
    std::vector<float> window_max[2];
};
inline constexpr int window_size[2] = {6, 16};

struct MarchGrid {
    MarchPlane rows;        // x along lanes
    MarchPlane transposed;  // y along lanes: for directions nearer to y (1.5-1.8 times faster there); empty
                            // if ny < march_block
    double pitch_x = 0, pitch_y = 0;
    float lowest = 0, highest = 0;  // in cells
    BaseCurvature base;             // as of the surface
    double max_slope = 0;  // a ray steeper than this can hit nothing: max |grad h| over facets (metric), and
                           // on a curved base what bending adds to that

    bool has_transposed() const { return !transposed.heights.empty(); }
};

MarchGrid make_march_grid(const HeightField& surface);

// A direction in the coordinates of the march: unit horizontal step in cells, and rise (in pitch_x) per cell
// of travel.
struct MarchDirection {
    double step_x = 0, step_y = 0, rise = 0;
};
MarchDirection to_march_direction(const MarchGrid& grid, const Vec3& direction);

// A rectangle of cells; x0, y0 may wrap around the period.
struct CellRect {
    int x0 = 0, y0 = 0, width = 0, height = 0;
    bool operator==(const CellRect&) const = default;
};

}  // namespace gonio
