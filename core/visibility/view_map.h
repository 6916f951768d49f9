// What a camera far away sees: for every pixel of the base plane, the facet part that its view ray meets. All
// pixels of one view are parallel rays, so those at the same place inside their cells share one list of
// crossings and march in lockstep.
#pragma once
#include <cstdint>
#include <vector>

#include "visibility/grid_tracer.h"
#include "visibility/march_grid.h"

namespace gonio {

// Facet parts without padding: ((part * 2 + kind) * ny + row) * nx + column, of an nx x ny surface.
inline size_t facet_index(int nx, int ny, int part, int kind, int row, int column) {
    return ((static_cast<size_t>(part) * 2 + kind) * ny + row) * nx + column;
}

// nx * ny pixels over a rectangle of cells; pixel (i, j) is the place (i + 1/2, j + 1/2) / (nx, ny) of it,
// row 0 at low y. A view ray belongs to the pixel where it passes the plane z = plane_height (metres above
// the mean height, as HeightField::heights): so pixels of different views that show one point of that plane
// are the same pixel (parallax-correct).
struct PixelGrid {
    CellRect area;
    int nx = 0, ny = 0;
    double plane_height = 0;
};

struct ViewMap {
    std::vector<uint32_t> facet;  // [j * nx + i]: facet_index
    long long unresolved = 0;     // nearly horizontal rays given up: these pixels show where they were then
};

// view.z > 0, unit. (sample_x, sample_y): the place inside the pixel, in [0, 1); (1/2, 1/2) is its centre.
// refinement: parts of a facet along each side. On a curved base the view is told in the frame of the pixel
// and its rays are bent; one that leaves over the horizon of the base counts as unresolved.
ViewMap make_view_map(const MarchGrid& grid, const Vec3& view, const PixelGrid& pixels, double sample_x,
                      double sample_y, int refinement);

// The same for a camera at `place` (x, y of the surface, z above its mean height; metres), above the relief
// and the pixels' plane: each pixel has a ray of its own (grid_tracer.h). A ray within 1e-6 of a cell of an
// edge may show the facet beyond it.
ViewMap make_camera_map(const TraceGrid& grid, const HeightField& surface, const Vec3& place,
                        const PixelGrid& pixels, double sample_x, double sample_y, int refinement);

}  // namespace gonio
