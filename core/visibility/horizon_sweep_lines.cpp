#include "visibility/horizon_sweep_lines.h"

#include <algorithm>
#include <cmath>

namespace gonio {
namespace {

// Weights of a triangle's corners: (0, 0), the second node, (1, 1); a along the plane's rows, b along its
// contiguous axis.
struct TriangleWeights {
    double own, second, opposite;
    bool second_is_next_row;
};
TriangleWeights triangle_weights(double a, double b) {
    if (a >= b) return {1 - a, a - b, b, true};
    return {1 - b, b - a, a, false};
}

}  // namespace

SweepLines make_sweep_lines(const MarchGrid& grid, const RayBundle& flat, double travel) {
    SweepLines lines;
    // The bundle marches with its lanes along the axis nearer to the azimuth; the sweep's lanes lie across.
    lines.transposed = !flat.transposed;
    lines.plane = lines.transposed ? &grid.transposed : &grid.rows;
    const MarchPlane& plane = *lines.plane;
    const double along = flat.direction.step_x, across = flat.direction.step_y, a = flat.start.u,
                 b = flat.start.v, shear = across / std::abs(along);
    lines.backwards = along < 0;
    lines.shear = static_cast<float>(shear);
    const int sign = lines.backwards ? -1 : 1;
    const double pitch_along = flat.transposed ? grid.pitch_y : grid.pitch_x,
                 pitch_across = flat.transposed ? grid.pitch_x : grid.pitch_y;
    lines.column = std::hypot(pitch_along, shear * pitch_across);
    lines.first_edge = lines.backwards ? (a > 0 ? a : 1) : 1 - a;
    lines.n_steps = plane.ny + static_cast<int>(travel * std::abs(along)) + 1;

    for (int step = 0; step < lines.n_steps; ++step) {
        const double from_receiver = shear * step, place = b + from_receiver;
        const TriangleWeights w = triangle_weights(a, fractional_part(place));
        lines.samples.push_back(
            {wrap_index(sign * static_cast<long long>(step), plane.ny),
             wrap_index(static_cast<long long>(std::floor(place)), plane.nx),
             wrap_index(-static_cast<long long>(std::floor(from_receiver)) - 1, plane.nx),
             {static_cast<float>(w.own), static_cast<float>(w.second), static_cast<float>(w.opposite)},
             w.second_is_next_row ? plane.stride : 1});
    }
    // Tangents end at most n_steps - 1 columns ahead, and one more edge is looked at.
    const double period = plane.nx;
    const int n_edges = lines.n_steps + 4, edge_of_cell = lines.backwards && a > 0 ? 1 : 0;
    for (int k = 0; k < n_edges; ++k) {
        const double place = b + shear * (lines.first_edge + k - 1);
        const float wrapped = static_cast<float>(place - period * std::floor(place / period));
        lines.edge_shift.push_back(wrapped < static_cast<float>(period) ? wrapped : 0.0f);
    }
    for (int k = 0; k < plane.ny + n_edges; ++k)
        lines.edge_rows.push_back(wrap_index(sign * static_cast<long long>(k - edge_of_cell), plane.ny) *
                                  plane.stride);

    const MarchPlane& marched = flat.transposed ? grid.transposed : grid.rows;
    for (size_t k = 0; k < flat.crossings.size(); ++k) {
        const Crossing& c = flat.crossings[k];
        const int second_node = c.second_node == 1                ? plane.stride
                                : c.second_node == marched.stride ? 1
                                                                  : plane.stride + 1;
        lines.near_edges.push_back({c.weight0, c.weight1,
                                    flat.facets[k].travel * static_cast<float>(std::abs(along)), c.column,
                                    c.row, second_node});
    }
    const TriangleWeights w = triangle_weights(a, b);
    lines.receiver_weight[0] = static_cast<float>(w.own);
    lines.receiver_weight[1] = static_cast<float>(w.second);
    lines.receiver_weight[2] = static_cast<float>(w.opposite);
    lines.receiver_second_node = w.second_is_next_row ? plane.stride : 1;
    return lines;
}

}  // namespace gonio
