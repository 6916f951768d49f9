#include "fitting/ndf.h"

#include "base/error.h"
#include "fitting/effective_size.h"
#include "fitting/fit_slopes.h"
#include "fitting/slope_cells.h"

namespace gonio {
namespace {

// n_theta even bins up to where 99.9 % of the base plane is reached, ten more to the horizon: one steep spike
// must not spoil the resolution of all the rest.
std::vector<double> theta_edges(const SlopeSums& sums, int n_theta) {
    constexpr int n_tail = 10;
    double fine_deg = degrees(std::atan(1.05 * slope_quantile(sums, 0.999, false)));
    fine_deg = sums.max_slope > 0 ? std::min(fine_deg, 89.0) : 60.0;
    std::vector<double> edges;
    for (int k = 0; k < n_theta; ++k) edges.push_back(fine_deg * k / n_theta);
    for (int k = 0; k < n_tail; ++k) edges.push_back(fine_deg + (90 - fine_deg) * k / n_tail);
    edges.push_back(90);
    return edges;
}

NdfTable tabulate(const HeightField& surface, const SlopeSums& sums, const NdfOptions& options) {
    NdfTable table;
    table.theta_edges_deg = theta_edges(sums, options.n_theta);
    table.n_phi = options.n_phi;
    const std::vector<double>& edges = table.theta_edges_deg;
    const int n_phi = table.n_phi, n_theta = table.n_theta();
    const double fine_deg = edges[options.n_theta], tail_deg = (90 - fine_deg) / (n_theta - options.n_theta);
    const double to_fine = options.n_theta / fine_deg, to_phi = n_phi / (2 * pi);

    std::vector<double> area(static_cast<size_t>(n_theta) * n_phi);
    for_each_facet(surface, [&](const Gradient& g) {
        const double size = g.x * g.x + g.y * g.y;
        if (size == 0) return;
        const double theta_deg = degrees(std::atan(std::sqrt(size)));
        const int t = theta_deg < fine_deg
                          ? static_cast<int>(theta_deg * to_fine)
                          : options.n_theta + static_cast<int>((theta_deg - fine_deg) / tail_deg);
        // Bins are centred on the axes, where the normals (-p, -q, 1) of grooves lie: an edge there would be
        // a matter of sign.
        const int p = static_cast<int>(std::floor(std::atan2(-g.y, -g.x) * to_phi + 0.5));
        area[static_cast<size_t>(std::min(t, n_theta - 1)) * n_phi + (p < 0        ? p + n_phi
                                                                      : p >= n_phi ? p - n_phi
                                                                                   : p)] +=
            std::sqrt(1 + size);
    });
    // A level facet has no azimuth.
    for (int p = 0; p < n_phi; ++p) area[p] += static_cast<double>(sums.n_level) / n_phi;

    table.d.resize(area.size());
    for (int t = 0; t < n_theta; ++t) {
        const double c0 = std::cos(radians(edges[t])), c1 = std::cos(radians(edges[t + 1]));
        const double solid_angle = (c0 - c1) * 2 * pi / n_phi,
                     projected = 0.5 * (c0 * c0 - c1 * c1) * 2 * pi / n_phi;
        for (int p = 0; p < n_phi; ++p) {
            const size_t k = static_cast<size_t>(t) * n_phi + p;
            table.d[k] = area[k] / (static_cast<double>(sums.n) * solid_angle);
            table.projected_area_norm += table.d[k] * projected;
        }
    }
    return table;
}

}  // namespace

NdfResult measure_ndf(const HeightField& surface, const NdfOptions& options) {
    if (options.n_theta < 1 || options.n_phi < 1) {
        throw Error(ErrorCode::invalid_input, "n_theta, n_phi",
                    std::to_string(options.n_theta) + ", " + std::to_string(options.n_phi),
                    "at least one bin each");
    }
    const SlopeSums sums = sum_slopes(surface);
    if (sums.n == 0)
        throw Error(ErrorCode::invalid_input, "surface", "", "no facet lies inside the measured border");

    NdfResult result;
    result.table = tabulate(surface, sums, options);
    result.n_facets = sums.n;
    result.mean_slope_x = sums.mean_x;
    result.mean_slope_y = sums.mean_y;
    result.rms_slope_x = std::sqrt(sums.xx);
    result.rms_slope_y = std::sqrt(sums.yy);
    result.max_slope = sums.max_slope;
    result.n_effective =
        effective_size(surface, principal_rotation({static_cast<double>(sums.n), sums.xx, sums.xy, sums.yy}));
    result.fits = fit_slopes(gather_cells(surface, sums), result.n_effective);

    // Where all slopes lie on one line, only the fits along that line have a likelihood to compare.
    const bool on_a_line =
        result.fits[1].alpha > 0 && (result.fits[1].alpha_x == 0 || result.fits[1].alpha_y == 0);
    for (int k = 0; k < static_cast<int>(result.fits.size()); ++k) {
        const NdfFit& fit = result.fits[k];
        if (!fit.converged || (on_a_line && fit.isotropic)) continue;
        if (result.best < 0 || fit.aic < result.fits[result.best].aic) result.best = k;
    }
    result.message = sums.max_slope == 0 ? "the surface is flat"
                     : result.best < 0   ? "no fit converged"
                     : result.n_effective.alpha < 30
                         ? "the patch holds few correlation lengths: standard errors are themselves uncertain"
                         : "done";
    return result;
}

std::vector<NdfFit> fit_ndf(const std::vector<Gradient>& slopes) {
    if (slopes.empty()) throw Error(ErrorCode::invalid_input, "slopes", "0", "at least one is needed");
    std::vector<SlopeCell> cells;
    cells.reserve(slopes.size());
    for (const Gradient& g : slopes) cells.push_back({1, g.x * g.x, g.x * g.y, g.y * g.y});
    const double n = static_cast<double>(slopes.size());
    return fit_slopes(cells, {n, n, n, n});
}

}  // namespace gonio
