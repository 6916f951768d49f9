#include "visibility/view_map.h"

#include <cmath>
#include <numeric>

#include "visibility/march.h"
#include "visibility/ray_cast.h"

namespace gonio {
namespace {

constexpr double max_view_travel = 1 << 18;  // cells: 89.8 degrees on a relief of 1000 cells of height

// Pixels along one axis that lie at the same place inside their cells: `count` of them, `step` cells apart.
struct Axis {
    int n_classes, count, step;
    Axis(int cells, int pixels) {
        count = std::gcd(cells, pixels);
        n_classes = pixels / count;
        step = cells / count;
    }
};

// Cell and place inside it.
struct Place {
    int cell;
    double inside;
    Place(double position, int n) {
        const double whole = std::floor(position);
        inside = std::min(position - whole, 1 - 0x1p-40);
        cell = wrap_index(static_cast<long long>(whole), n);
    }
};

// Part of the facet (kind, column, row) that the falling ray meets: both are linear, so one division tells
// where.
int part_of_hit(const MarchPlane& plane, const RayBundle& bundle, const CrossedFacet& facet, int column,
                int row, int refinement) {
    const float* h = &plane.heights[static_cast<size_t>(row) * plane.stride + column];
    const double h00 = h[0], h11 = h[plane.stride + 1], own = h[facet.kind == 0 ? 1 : plane.stride];
    const double slope_u = facet.kind == 0 ? own - h00 : h11 - own,
                 slope_v = facet.kind == 0 ? h11 - own : own - h00;
    const auto [step_u, step_v, rise] = bundle.direction;
    const double u = bundle.start.u - facet.column, v = bundle.start.v - facet.row;
    const double gap = h00 + slope_u * u + slope_v * v - bundle.start_height,
                 closing = rise - slope_u * step_u - slope_v * step_v;
    const double travel = closing < 0 ? gap / closing : 0;
    double hit_u = u + step_u * travel, hit_v = v + step_v * travel;
    const int kind = bundle.transposed ? 1 - facet.kind : facet.kind;
    if (bundle.transposed) std::swap(hit_u, hit_v);
    return facet_part(kind, hit_u, hit_v, refinement);
}

}  // namespace

ViewMap make_view_map(const MarchGrid& grid, const Vec3& view, const PixelGrid& pixels, double sample_x,
                      double sample_y, int refinement) {
    ViewMap map;
    map.facet.resize(static_cast<size_t>(pixels.nx) * pixels.ny);
    const int nx = grid.rows.nx, ny = grid.rows.ny;
    // From the pixel's plane up to the highest point, along the view ray.
    const double climb = grid.highest - pixels.plane_height / grid.pitch_x, shift_x = climb * view.x / view.z,
                 shift_y = climb * view.y / view.z * (grid.pitch_x / grid.pitch_y);
    const Axis x_axis(pixels.area.width, pixels.nx), y_axis(pixels.area.height, pixels.ny);
    HitLines lines;
    for (int cy = 0; cy < y_axis.n_classes; ++cy)
        for (int cx = 0; cx < x_axis.n_classes; ++cx) {
            const Place x(pixels.area.x0 + (cx + sample_x) * pixels.area.width / pixels.nx + shift_x, nx),
                y(pixels.area.y0 + (cy + sample_y) * pixels.area.height / pixels.ny + shift_y, ny);
            const RayBundle bundle = make_view_bundle(grid, view, x.inside, y.inside, max_view_travel);
            const bool turned = bundle.transposed;
            const MarchPlane& plane = turned ? grid.transposed : grid.rows;
            const Axis &along = turned ? y_axis : x_axis, &across = turned ? x_axis : y_axis;
            const int first_along = turned ? y.cell : x.cell, first_across = turned ? x.cell : y.cell;
            const int width = (along.count - 1) * along.step + 1, words = words_for(width);
            const int n_lines = across.step == 1 ? across.count : 1;
            const int last = static_cast<int>(bundle.crossings.size()) - 1;
            for (int q = 0; q < across.count; q += n_lines) {
                march_hits(grid, bundle, first_along, wrap_index(first_across + q * across.step, plane.ny),
                           width, n_lines, lines);
                for (int line = 0; line < n_lines; ++line)
                    for (int p = 0; p < along.count; ++p) {
                        const int lane = p * along.step;
                        const size_t at = static_cast<size_t>(line) * words + lane / march_block;
                        const bool hit = lines.hit[at] >> (lane % march_block) & 1;
                        const CrossedFacet& facet =
                            bundle.facets[hit ? lines.crossing[at * march_block + lane % march_block] : last];
                        map.unresolved += !hit;
                        int column = first_along + lane + facet.column,
                            row = first_across + (q + line) * across.step + facet.row;
                        if (column < 0 || column >= plane.nx) column = wrap_index(column, plane.nx);
                        if (row < 0 || row >= plane.ny) row = wrap_index(row, plane.ny);
                        const int part =
                            refinement == 1 ? 0 : part_of_hit(plane, bundle, facet, column, row, refinement);
                        const int i = cx + (turned ? q + line : p) * x_axis.n_classes,
                                  j = cy + (turned ? p : q + line) * y_axis.n_classes;
                        map.facet[static_cast<size_t>(j) * pixels.nx + i] = static_cast<uint32_t>(
                            turned ? facet_index(nx, ny, part, 1 - facet.kind, column, row)
                                   : facet_index(nx, ny, part, facet.kind, row, column));
                    }
            }
        }
    return map;
}

ViewMap make_camera_map(const MarchGrid& grid, const Vec3& place, const PixelGrid& pixels, double sample_x,
                        double sample_y, int refinement) {
    ViewMap map;
    map.facet.reserve(static_cast<size_t>(pixels.nx) * pixels.ny);
    const double top = grid.highest * grid.pitch_x;
    for (int j = 0; j < pixels.ny; ++j)
        for (int i = 0; i < pixels.nx; ++i) {
            const Vec3 pixel{
                (pixels.area.x0 + (i + sample_x) * pixels.area.width / pixels.nx) * grid.pitch_x,
                (pixels.area.y0 + (j + sample_y) * pixels.area.height / pixels.ny) * grid.pitch_y,
                pixels.plane_height};
            const Vec3 ray{pixel.x - place.x, pixel.y - place.y, pixel.z - place.z};
            const double climb =
                (top - pixel.z) / ray.z;  // from the pixel to the highest point, in lengths of `ray`
            const std::optional<uint32_t> facet = cast_from_above(
                grid, (pixel.x + climb * ray.x) / grid.pitch_x, (pixel.y + climb * ray.y) / grid.pitch_y,
                to_march_direction(grid, ray), refinement);
            map.facet.push_back(facet.value_or(0));
            map.unresolved += !facet;
        }
    return map;
}

}  // namespace gonio
