#include "visibility/view_map.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "visibility/march.h"

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

// i in [0, 2 n).
int into_period(int i, int n) {
    return i < n ? i : i - n;
}

// How far the relief stands above a falling ray at crossing k, whose cell (0, 0) is (column, row).
double above_ray(const MarchPlane& plane, const RayBundle& bundle, int k, int column, int row) {
    const Crossing& c = bundle.crossings[k];
    const float* node = &plane.heights[static_cast<size_t>(wrap_index(row + c.row, plane.ny)) * plane.stride +
                                       wrap_index(column + c.column, plane.nx)];
    return static_cast<double>(node[0]) * c.weight0 + static_cast<double>(node[c.second_node]) * c.weight1 -
           c.rise - bundle.start_height;
}

// Part of the facet (kind, column, row) that the falling ray meets just before crossing k: both are linear,
// so one division tells where, or, of a bent ray, the two crossings on either side.
int part_of_hit(const MarchPlane& plane, const RayBundle& bundle, int k, int column, int row,
                int refinement) {
    const CrossedFacet& facet = bundle.facets[k];
    if (bundle.bent && k > 0) {
        const int own_column = column - facet.column, own_row = row - facet.row;
        const double before = above_ray(plane, bundle, k - 1, own_column, own_row),
                     after = above_ray(plane, bundle, k, own_column, own_row),
                     share = after > before ? std::clamp(before / (before - after), 0.0, 1.0) : 0.0;
        auto [x, y] =
            bundle.path.at(bundle.facets[k - 1].travel +
                           share * (static_cast<double>(facet.travel) - bundle.facets[k - 1].travel));
        x -= facet.column, y -= facet.row;
        if (bundle.transposed) std::swap(x, y);
        return facet_part(bundle.transposed ? 1 - facet.kind : facet.kind, x, y, refinement);
    }
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
    const auto [shift_x, shift_y, entering] = view_entry(grid, view, pixels.plane_height / grid.pitch_x);
    const Axis x_axis(pixels.area.width, pixels.nx), y_axis(pixels.area.height, pixels.ny);
    HitLines lines;
    for (int cy = 0; cy < y_axis.n_classes; ++cy)
        for (int cx = 0; cx < x_axis.n_classes; ++cx) {
            const Place x(pixels.area.x0 + (cx + sample_x) * pixels.area.width / pixels.nx + shift_x, nx),
                y(pixels.area.y0 + (cy + sample_y) * pixels.area.height / pixels.ny + shift_y, ny);
            const RayBundle bundle = make_view_bundle(grid, entering, x.inside, y.inside, max_view_travel);
            const bool turned = bundle.transposed;
            const MarchPlane& plane = turned ? grid.transposed : grid.rows;
            const Axis &along = turned ? y_axis : x_axis, &across = turned ? x_axis : y_axis;
            const int first_along = turned ? y.cell : x.cell, first_across = turned ? x.cell : y.cell;
            const int width = (along.count - 1) * along.step + 1, words = words_for(width);
            const int n_lines = across.step == 1 ? across.count : 1;
            const int last = static_cast<int>(bundle.crossings.size()) - 1;
            // Where the facet behind a crossing lies for the ray of the first pixel.
            std::vector<int> columns, rows;
            for (const CrossedFacet& facet : bundle.facets) {
                columns.push_back(wrap_index(first_along + facet.column, plane.nx));
                rows.push_back(wrap_index(first_across + facet.row, plane.ny));
            }
            for (int q = 0; q < across.count; q += n_lines) {
                march_hits(grid, bundle, first_along, wrap_index(first_across + q * across.step, plane.ny),
                           width, n_lines, lines);
                const size_t stride = static_cast<size_t>(words) * march_block;
                for (int line = 0; line < n_lines; ++line)
                    for (int p = 0; p < along.count; ++p) {
                        const int lane = p * along.step;
                        if (!(lines.hit[static_cast<size_t>(line) * words + lane / march_block] >>
                                  (lane % march_block) &
                              1)) {
                            lines.crossing[line * stride + lane] = last;
                            ++map.unresolved;
                        }
                    }
                // Of the pixel at (line, p): the innermost loop runs along the rows of the image.
                const auto put = [&](int line, int p) {
                    const int lane = p * along.step, crossing = lines.crossing[line * stride + lane];
                    const CrossedFacet& facet = bundle.facets[crossing];
                    const int column = into_period(columns[crossing] + lane, plane.nx),
                              row = into_period(rows[crossing] + (q + line) * across.step, plane.ny);
                    const int part =
                        refinement == 1 ? 0 : part_of_hit(plane, bundle, crossing, column, row, refinement);
                    const int i = cx + (turned ? q + line : p) * x_axis.n_classes,
                              j = cy + (turned ? p : q + line) * y_axis.n_classes;
                    map.facet[static_cast<size_t>(j) * pixels.nx + i] =
                        static_cast<uint32_t>(turned ? facet_index(nx, ny, part, 1 - facet.kind, column, row)
                                                     : facet_index(nx, ny, part, facet.kind, row, column));
                };
                if (turned)
                    for (int p = 0; p < along.count; ++p)
                        for (int line = 0; line < n_lines; ++line) put(line, p);
                else
                    for (int line = 0; line < n_lines; ++line)
                        for (int p = 0; p < along.count; ++p) put(line, p);
            }
        }
    return map;
}

ViewMap make_camera_map(const TraceGrid& grid, const HeightField& surface, const Vec3& place,
                        const PixelGrid& pixels, double sample_x, double sample_y, int refinement) {
    constexpr size_t together = 4096;  // rays
    ViewMap map;
    map.facet.assign(static_cast<size_t>(pixels.nx) * pixels.ny, 0);
    RayBatch rays, hits, escaped;
    for (RayBatch* batch : {&rays, &hits, &escaped}) batch->reserve(together);
    std::vector<int32_t> lost;
    const double top = grid.highest * surface.pitch_x;
    const auto trace = [&] {
        map.unresolved += static_cast<long long>(trace_rays(grid, rays, hits, escaped, lost));
        for (size_t k = 0; k < hits.n; ++k)
            map.facet[hits.id[k]] = static_cast<uint32_t>(
                facet_index(grid.nx, grid.ny, facet_part(hits.kind[k], hits.u[k], hits.v[k], refinement),
                            hits.kind[k], hits.j[k], hits.i[k]));
    };
    // Along x and along y on their own: where the ray of a pixel passes the highest point, and its direction.
    struct Entry {
        Place place;
        double ray;
    };
    const double down = pixels.plane_height - place.z, climb = (top - pixels.plane_height) / down;
    const auto entries = [&](int n, int first, int length, double sample, double pitch, double camera,
                             int period) {
        std::vector<Entry> list;
        for (int k = 0; k < n; ++k) {
            const double pixel = (first + (k + sample) * length / n) * pitch, ray = pixel - camera;
            list.push_back({Place((pixel + climb * ray) / pitch, period), ray});
        }
        return list;
    };
    const std::vector<Entry> x = entries(pixels.nx, pixels.area.x0, pixels.area.width, sample_x,
                                         surface.pitch_x, place.x, grid.nx),
                             y = entries(pixels.ny, pixels.area.y0, pixels.area.height, sample_y,
                                         surface.pitch_y, place.y, grid.ny);
    for (int j = 0; j < pixels.ny; ++j)
        for (int i = 0; i < pixels.nx; ++i) {
            rays.add(grid, x[i].place.cell, y[j].place.cell, static_cast<float>(x[i].place.inside),
                     static_cast<float>(y[j].place.inside), grid.highest, {x[i].ray, y[j].ray, down},
                     j * pixels.nx + i);
            if (rays.n == together) trace();
        }
    trace();
    return map;
}

}  // namespace gonio
