// The steps of prepare_surface, one file each.
#pragma once
#include <array>
#include <string>
#include <vector>

#include "surface/prepare.h"

namespace gonio {

struct Grid {
    int nx = 0, ny = 0;
    std::vector<double> heights;  // nx * ny, row by row
};

// What the stored numbers are worth, in metres.
struct Scale {
    double pitch_x = 0, pitch_y = 0;
    double height = 0;  // metres per stored unit, > 0
};

// Pitch and height scale from what the user states, else from what the file carries, else
// Error(missing_unit). Deviations from the file are noted.
Scale resolve_units(const RawHeights& raw, const PrepareOptions& options, std::vector<std::string>& notes);

// Columns and rows [x, x + width) x [y, y + height). Throws Error("/surface/crop") if they are not all inside
// the grid.
Grid cropped(const Grid& grid, const std::array<int, 4>& crop);

void flip_rows(Grid& grid);

// Replaces NaN by the solution of Laplace's equation with the known neighbours as boundary values. Returns
// how many points.
size_t fill_missing(Grid& grid);

// Subtracts the mean, or the least-squares plane or quadric. pitch: of the grid, for the slopes in the note
// returned (empty for none).
std::string level_heights(Grid& grid, Level level, double pitch_x, double pitch_y);

// To nx x ny nodes over the same width and depth: box average down, bilinear up, each axis for itself.
// periodic: the neighbours of the last node are the first ones; else the grid is mirrored at its ends.
Grid resampled(const Grid& grid, int nx, int ny, bool periodic);

// 2 nx x 2 ny (an axis of one node stays one).
Grid mirrored(const Grid& grid);

}  // namespace gonio
