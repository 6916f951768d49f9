#include "visibility/march_grid.h"

#include <algorithm>
#include <cmath>

#include "surface/facet_mesh.h"
#include "visibility/march_bounds.h"

namespace gonio {
namespace {

// A block starts at a column below nx and reads march_block + 1 nodes from there; the lines of the horizon
// sweep go in blocks of up to 2 march_block.
constexpr int padding = 2 * march_block + 8;

std::vector<float> pad(const std::vector<float>& nodes, int nx, int ny, int stride) {
    std::vector<float> padded(static_cast<size_t>(ny + 2) * stride);
    for (int r = 0; r < ny + 2; ++r) {
        const float* from = &nodes[static_cast<size_t>(r % ny) * nx];
        float* to = &padded[static_cast<size_t>(r) * stride];
        for (int c = 0; c < stride; ++c) to[c] = from[c % nx];
    }
    return padded;
}

// Running maximum of n + 1 neighbours along a periodic line, by doubling: max over 2^k, then one overlapping
// pair.
template <class Line>
void sliding_max(Line&& line, int length, int n, std::vector<float>& a, std::vector<float>& b) {
    a.resize(length);
    b.resize(length);
    for (int i = 0; i < length; ++i) a[i] = line(i);
    int covered = 1;
    const int wanted = n + 1;
    auto widen = [&](int shift) {
        for (int i = 0; i < length; ++i) b[i] = std::max(a[i], a[(i + shift) % length]);
        a.swap(b);
    };
    for (; 2 * covered <= wanted; covered *= 2) widen(covered);
    if (covered < wanted) widen(wanted - covered);
    for (int i = 0; i < length; ++i) line(i) = a[i];
}

std::vector<float> window_maxima(std::vector<float> nodes, int nx, int ny, int stride, int window) {
    std::vector<float> a, b;
    for (int r = 0; r < ny; ++r)
        sliding_max([&](int i) -> float& { return nodes[static_cast<size_t>(r) * nx + i]; }, nx, window, a,
                    b);
    // Down the columns a row at a time (whole-row maxima), so that memory is walked in order.
    std::vector<float> widened(nodes.size());
    int covered = 1;
    const int wanted = window + 1;
    auto widen = [&](int shift) {
        for (int r = 0; r < ny; ++r) {
            const float* p = &nodes[static_cast<size_t>(r) * nx];
            const float* q = &nodes[static_cast<size_t>((r + shift) % ny) * nx];
            float* to = &widened[static_cast<size_t>(r) * nx];
            for (int c = 0; c < nx; ++c) to[c] = std::max(p[c], q[c]);
        }
        nodes.swap(widened);
    };
    for (; 2 * covered <= wanted; covered *= 2) widen(covered);
    if (covered < wanted) widen(wanted - covered);
    return pad(nodes, nx, ny, stride);
}

MarchPlane make_plane(const std::vector<float>& nodes, int nx, int ny) {
    MarchPlane plane;
    plane.nx = nx;
    plane.ny = ny;
    plane.stride = nx + padding;
    plane.heights = pad(nodes, nx, ny, plane.stride);
    for (int w = 0; w < 2; ++w)
        plane.window_max[w] = window_maxima(nodes, nx, ny, plane.stride, window_size[w]);
    return plane;
}

// A chord is parallel to some tangent of the profile that it cuts, and profiles are at most `slope` steep but
// for the stretching of the base. A hollow turns tangents up on the way, by its curvature times the length of
// the chord, which ends where it leaves the layer of the relief (crossings.h).
double steepest_ray(const MarchGrid& grid, double slope) {
    if (!grid.base.is_curved()) return slope;
    const double kappas[] = {grid.base.kappa_1 * grid.pitch_x, grid.base.kappa_2 * grid.pitch_x};
    const double low = grid.lowest, high = grid.highest;
    double steepest = 0;
    for (const double kappa : kappas) {
        const double stretched = slope / (1 + std::min(kappa * low, kappa * high));
        const double within = std::max(stretched, std::sqrt(2 * std::max(0.0, -kappa) * (high - low))),
                     turn = std::max(0.0, -kappa) * 2 * (high - low) / std::max(within, 1e-30);
        const double up = std::atan(stretched) + turn;
        steepest = std::max(steepest, up < 1.5 ? std::max(within, std::tan(up)) : 1e6);
    }
    return steepest;
}

std::vector<float> heights_in_cells(const HeightField& surface) {
    std::vector<float> nodes(surface.heights.size());
    for (size_t k = 0; k < nodes.size(); ++k)
        nodes[k] = static_cast<float>(static_cast<double>(surface.heights[k]) / surface.pitch_x);
    return nodes;
}

MarchGrid bounds(const HeightField& surface, const std::vector<float>& nodes) {
    MarchGrid grid;
    grid.pitch_x = surface.pitch_x;
    grid.pitch_y = surface.pitch_y;
    const int nx = surface.nx, ny = surface.ny;
    const auto [low, high] = std::minmax_element(nodes.begin(), nodes.end());
    grid.lowest = *low;
    grid.highest = *high;

    const double aspect =
        surface.pitch_x / surface.pitch_y;  // nodes are in pitch_x: slope along y is dh * aspect
    double steepest_squared = 0;
    for (int j = 0; j < ny; ++j) {
        const float* row = &nodes[static_cast<size_t>(j) * nx];
        const float* next = &nodes[static_cast<size_t>((j + 1) % ny) * nx];
        for (int i = 0; i < nx; ++i) {
            const int i1 = i + 1 == nx ? 0 : i + 1;
            const double gx0 = static_cast<double>(row[i1]) - row[i],
                         gy0 = (static_cast<double>(next[i1]) - row[i1]) * aspect;
            const double gx1 = static_cast<double>(next[i1]) - next[i],
                         gy1 = (static_cast<double>(next[i]) - row[i]) * aspect;
            steepest_squared = std::max({steepest_squared, gx0 * gx0 + gy0 * gy0, gx1 * gx1 + gy1 * gy1});
        }
    }
    grid.base = surface.base;
    grid.max_slope = steepest_ray(grid, std::sqrt(steepest_squared));
    return grid;
}

}  // namespace

MarchGrid march_bounds(const HeightField& surface) {
    return bounds(surface, heights_in_cells(surface));
}

MarchGrid make_march_grid(const HeightField& surface) {
    const std::vector<float> nodes = heights_in_cells(surface);
    const int nx = surface.nx, ny = surface.ny;
    MarchGrid grid = bounds(surface, nodes);
    grid.rows = make_plane(nodes, nx, ny);
    if (ny >= march_block) {
        std::vector<float> turned(nodes.size());
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i)
                turned[static_cast<size_t>(i) * ny + j] = nodes[static_cast<size_t>(j) * nx + i];
        grid.transposed = make_plane(turned, ny, nx);
    }
    return grid;
}

MarchDirection to_march_direction(const MarchGrid& grid, const Vec3& direction) {
    const double x = direction.x,
                 y = direction.y * (grid.pitch_x / grid.pitch_y);  // travel in cells, times pitch_x
    const double travel = std::hypot(x, y);
    if (travel < 1e-12)
        return {1, 0, direction.z * 1e12};  // vertical: rises out of every relief within its own cell
    return {x / travel, y / travel, direction.z / travel};
}

}  // namespace gonio
