#include "visibility/horizon_map.h"

#include <cmath>

#include "base/parallel.h"
#include "visibility/horizon_sweep.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr double near_travel = 3;  // cells: the edges that every receiver of the sweep looks at

// Cells of travel beyond which nothing rises above the smallest slope.
double reach(const MarchGrid& grid, const RayBundle& flat, double smallest_slope) {
    const double step_x = flat.transposed ? flat.direction.step_y : flat.direction.step_x,
                 step_y = flat.transposed ? flat.direction.step_x : flat.direction.step_y;
    const double cell = std::hypot(step_x * grid.pitch_x, step_y * grid.pitch_y),
                 range = (static_cast<double>(grid.highest) - grid.lowest) * grid.pitch_x;
    return std::min(max_horizon_travel, range / (smallest_slope * cell) + 2);
}

}  // namespace

HorizonSlice compute_horizon(const MarchGrid& grid, double azimuth, const FacetPoint& receiver,
                             const HorizonOptions& options) {
    auto exact = [](double c) { return std::abs(c) < 1e-15 ? 0.0 : c; };
    const Vec3 direction{exact(std::cos(azimuth)), exact(std::sin(azimuth)), 0};
    const RayBundle first_crossings = make_level_bundle(grid, direction, receiver, near_travel);
    if (!options.exact && can_sweep(grid))
        return sweep_horizon(grid, first_crossings, reach(grid, first_crossings, options.smallest_slope));

    const int nx = grid.rows.nx, ny = grid.rows.ny;
    HorizonSlice slice;
    slice.slope.resize(static_cast<size_t>(nx) * ny);
    slice.distance.resize(slice.slope.size());
    march_horizon(grid, make_level_bundle(grid, direction, receiver, max_horizon_travel), {0, 0, nx, ny},
                  slice.slope.data(), slice.distance.data());
    return slice;
}

HorizonMap make_horizon_map(const MarchGrid& grid, const std::vector<double>& azimuths,
                            const FacetPoint& receiver, const HorizonOptions& options, int n_threads,
                            const Monitor& monitor) {
    HorizonMap map{grid.rows.nx, grid.rows.ny, receiver, azimuths, {}};
    map.slices.resize(azimuths.size());
    parallel_for(static_cast<int>(azimuths.size()), n_threads, [&](int k) {
        monitor.check_cancelled();
        map.slices[k] = compute_horizon(grid, azimuths[k], receiver, options);
    });
    return map;
}

std::vector<double> uniform_azimuths(int n, double shift) {
    std::vector<double> azimuths(n);
    for (int k = 0; k < n; ++k) azimuths[k] = (k + shift) * 2 * pi / n;
    return azimuths;
}

}  // namespace gonio
