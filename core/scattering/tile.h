// The piece of the surface that one run works on: the whole period where that is small, else a window drawn
// at random whose core is measured and whose halo supplies the light that the core receives from around it.
#pragma once
#include <cstdint>
#include <vector>

#include "surface/height_field.h"
#include "visibility/march_grid.h"

namespace gonio {

// Facets are numbered by slot = (kind * height + row) * stride + column inside the tile; columns from `width`
// to `stride` are padding with area 0. An unknown is one part of a facet: part * n_slots + slot.
struct Tile {
    CellRect area;       // the tile's cells, halo included; area.x0, area.y0 are cells of the surface
    CellRect core;       // measured cells, relative to area
    int nx = 0, ny = 0;  // of the whole surface
    int stride = 0;      // padded width
    int refinement = 1;  // each facet is refinement^2 parts
    bool closed_x = false, closed_y = false;  // the tile spans the whole period: no ray leaves it that way
    std::vector<float> normal_x, normal_y, normal_z;  // per slot, metric unit normals
    std::vector<float>
        sqrt_area;  // per slot: sqrt of the area of one part, in units of pitch_x * pitch_y; 0 in the padding

    int n_parts() const { return refinement * refinement; }
    size_t n_slots() const { return 2 * static_cast<size_t>(area.height) * stride; }
    size_t n_unknowns() const { return n_parts() * n_slots(); }
    size_t slot(int kind, int row, int column) const {
        return (static_cast<size_t>(kind) * area.height + row) * stride + column;
    }
    double core_area() const { return static_cast<double>(core.width) * core.height; }

    // The core's slots as runs of neighbours, the same for every part.
    struct Run {
        size_t first, count;
    };
    std::vector<Run> core_runs() const;
};

Tile make_tile(const HeightField& surface, const CellRect& area, const CellRect& core, int refinement);

}  // namespace gonio
