#include "scattering/ray_hits.h"

#include <algorithm>

namespace gonio {

int hit_part(const MarchGrid& grid, const RayBundle& rays, int cell_x, int cell_y, int k, int refinement,
             int kind) {
    const MarchPlane& plane = rays.transposed ? grid.transposed : grid.rows;
    const int own_column = rays.transposed ? cell_y : cell_x,
              own_row = rays.transposed ? cell_x : cell_y;  // of the surface
    const float* own = &plane.heights[static_cast<size_t>(own_row) * plane.stride + own_column];
    const float height = own[0] * rays.start_weight[0] +
                         own[rays.start.kind == 0 ? 1 : plane.stride] * rays.start_weight[1] +
                         own[plane.stride + 1] * rays.start_weight[2];
    auto above = [&](int crossing) {
        const Crossing& c = rays.crossings[crossing];
        int column = own_column + c.column, row = own_row + c.row;
        if (column >= plane.nx) column -= plane.nx;
        if (row >= plane.ny) row -= plane.ny;
        const float* p = &plane.heights[static_cast<size_t>(row) * plane.stride + column];
        return static_cast<double>(p[0]) * c.weight0 + static_cast<double>(p[c.second_node]) * c.weight1 -
               c.rise - height;
    };
    const double before = above(k - 1), after = above(k);  // < 0, > 0
    const double share = std::clamp(before / (before - after), 0.0, 1.0);
    const double travel = rays.facets[k - 1].travel +
                          share * (static_cast<double>(rays.facets[k].travel) - rays.facets[k - 1].travel);
    const auto [x, y] = rays.path.at(travel);
    double u = x - rays.facets[k].column, v = y - rays.facets[k].row;
    if (rays.transposed) std::swap(u, v);
    return facet_part(kind, u, v, refinement);
}

}  // namespace gonio
