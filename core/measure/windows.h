// Which piece of the surface is worked on: the whole period, or windows whose core is measured and whose halo
// supplies the light that the core receives from around it.
#pragma once
#include <vector>

#include "measure/run.h"

namespace gonio {

inline constexpr int tile_core = 128, tile_halo = 32;  // cells

// The tiles of one run: the whole period, or a lattice of windows at a random shift in [0, 1)^2.
std::vector<Tile> run_tiles(const MeasuredScene& scene, const RunSettings& settings, double shift_x,
                            double shift_y);

// The whole period as one tile, its measured core without the border of an open surface.
Tile whole_tile(const MeasuredScene& scene, const RunSettings& settings);

// For side measurements that need not be done for every direction and everywhere: up to 16 of the lights and
// views, and the whole period or, if the runs use windows or the surface is large, one window in its middle.
std::vector<Vec3> probe_directions(const MeasuredScene& scene);
Tile probe_tile(const MeasuredScene& scene, const RunSettings& settings, int refinement);

}  // namespace gonio
