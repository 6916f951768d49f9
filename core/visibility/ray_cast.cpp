#include "visibility/ray_cast.h"

#include <cmath>

#include "base/numeric.h"
#include "visibility/crossings.h"
#include "visibility/view_map.h"

namespace gonio {
namespace {

constexpr double max_travel = 1 << 18;  // cells
constexpr double slack = 1e-9;          // of a cell: no ray slips between two facets

struct Cast {
    const MarchPlane& plane;
    double x, y, z;
    MarchDirection d;

    double height(double travel) const { return z + d.rise * travel; }

    // Cells of travel over which the ray stays above a square of the search maxima that begins in its cell; 0
    // if it may not.
    double leap(double travel, int i, int j) const {
        for (int w = 1; w >= 0; --w) {
            const int reach = window_size[w] - 1;
            const double length = reach / std::max(std::abs(d.step_x), std::abs(d.step_y));
            const int column = wrap_index(d.step_x > 0 ? i : i - reach, plane.nx),
                      row = wrap_index(d.step_y > 0 ? j : j - reach, plane.ny);
            if (height(travel + length) >
                plane.window_max[w][static_cast<size_t>(row) * plane.stride + column])
                return length;
        }
        return 0;
    }

    // The part of cell (i, j) that is met between two travels.
    std::optional<uint32_t> meet(int i, int j, double from, double to, int refinement) const {
        const int column = wrap_index(i, plane.nx), row = wrap_index(j, plane.ny);
        const float* h = &plane.heights[static_cast<size_t>(row) * plane.stride + column];
        const double h00 = h[0], h10 = h[1], h01 = h[plane.stride], h11 = h[plane.stride + 1];
        double nearest = to + slack;
        std::optional<uint32_t> met;
        for (int kind = 0; kind < 2; ++kind) {
            const double gu = kind == 0 ? h10 - h00 : h11 - h01, gv = kind == 0 ? h11 - h10 : h01 - h00;
            const double closing = d.rise - gu * d.step_x - gv * d.step_y;
            if (closing >= 0) continue;  // the facet's back
            const double travel = (h00 + gu * (x - i) + gv * (y - j) - z) / closing;
            if (travel < from - slack || travel >= nearest) continue;
            const double u = x + d.step_x * travel - i, v = y + d.step_y * travel - j;
            if (kind == 0 ? u < v - slack : v < u - slack) continue;
            nearest = travel;
            met = static_cast<uint32_t>(
                facet_index(plane.nx, plane.ny, facet_part(kind, u, v, refinement), kind, row, column));
        }
        return met;
    }
};

}  // namespace

std::optional<uint32_t> cast_from_above(const MarchGrid& grid, double x, double y,
                                        const MarchDirection& direction, int refinement) {
    const Cast cast{grid.rows, x, y, grid.highest, direction};
    double travel = 0;
    int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
    while (travel < max_travel) {
        if (const double length = cast.leap(travel, i, j); length > 0) {
            travel += length;
            i = static_cast<int>(std::floor(x + direction.step_x * travel));
            j = static_cast<int>(std::floor(y + direction.step_y * travel));
            continue;
        }
        const auto exit = [](double start, double step, int cell) {
            return step == 0 ? 1e300 : ((step > 0 ? cell + 1 : cell) - start) / step;
        };
        const double exit_x = exit(x, direction.step_x, i), exit_y = exit(y, direction.step_y, j),
                     next = std::max(travel, std::min(exit_x, exit_y));
        if (const auto met = cast.meet(i, j, travel, next, refinement)) return met;
        if (exit_x <= exit_y)
            i += direction.step_x > 0 ? 1 : -1;
        else
            j += direction.step_y > 0 ? 1 : -1;
        travel = next;
    }
    return std::nullopt;
}

}  // namespace gonio
