#include "visibility/corrected_horizon.h"

#include <algorithm>
#include <cmath>

#include "visibility/curvature.h"

namespace gonio {

void corrected_visible(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                       const CellRect& rect, uint32_t* visible) {
    const double horizontal = std::hypot(direction.x, direction.y);
    const int words = words_for(rect.width);
    std::fill_n(visible, static_cast<size_t>(words) * rect.height, 0u);
    // Relief that a flat base shows lower than a hundredth is bent out of sight, or hardly there.
    constexpr double lowest_slope = 0.01, longest = 16384;
    const double slope = direction.z / std::max(horizontal, 1e-12),
                 range = static_cast<double>(grid.highest) - grid.lowest;
    const Vec3 level{direction.x / std::max(horizontal, 1e-12), direction.y / std::max(horizontal, 1e-12), 0};
    const double travel = std::min(longest, range / std::clamp(slope, lowest_slope, 1e9) + 2);
    const RayBundle bundle =
        make_level_bundle(grid, horizontal > 1e-12 ? level : Vec3{1, 0, 0}, start, travel);
    const size_t n = static_cast<size_t>(rect.width) * rect.height;
    std::vector<float> horizon(n), distance(n);
    march_horizon(grid, bundle, rect, horizon.data(), distance.data());
    const double kappa = horizontal > 1e-12 ? grid.base.along(direction.x, direction.y) : 0;
    const HorizonCorrection correction = grid.base.correction == BaseCorrection::printed
                                             ? HorizonCorrection::printed
                                             : HorizonCorrection::exact;
    const MarchPlane& plane = grid.rows;
    const double own_weight[3] = {start.kind == 0 ? 1 - start.u : 1 - start.v, std::abs(start.u - start.v),
                                  start.kind == 0 ? start.v : start.u};
    for (int row = 0; row < rect.height; ++row)
        for (int column = 0; column < rect.width; ++column) {
            const int i = (rect.x0 + column) % plane.nx, j = (rect.y0 + row) % plane.ny;
            const float* node = &plane.heights[static_cast<size_t>(j) * plane.stride + i];
            const double height = grid.pitch_x * (own_weight[0] * node[0] +
                                                  own_weight[1] * node[start.kind == 0 ? 1 : plane.stride] +
                                                  own_weight[2] * node[plane.stride + 1]);
            const size_t at = static_cast<size_t>(row) * rect.width + column;
            if (slope > corrected_horizon_slope(horizon[at], distance[at], height, kappa, correction))
                visible[static_cast<size_t>(row) * words + column / 32] |= 1u << (column % 32);
        }
}

bool visible_on_base(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start, double max_travel,
                     const CellRect& rect, uint32_t* visible) {
    if (!grid.base.corrects_horizons())
        return visible_along(grid, direction, start, max_travel, rect, visible);
    corrected_visible(grid, direction, start, rect, visible);
    return false;
}

}  // namespace gonio
