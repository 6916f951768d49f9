#include "measure/mesh_bias.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "measure/windows.h"
#include "surface/facet_mesh.h"

namespace gonio {
namespace {

// Error falls with the square of the part's size: half the size leaves a quarter, so the whole error is 4/3
// of the difference.
constexpr double whole = 4.0 / 3;

// Where the pairs of the table stand in a matrix of lights x views (or x lights, if they are the views).
std::vector<size_t> asked_entries(const RunContext& context, int n_columns) {
    std::vector<size_t> entries;
    const size_t n_views = context.views.size();
    for (size_t row = 0; row < context.rows(); ++row) {
        const auto [light, view] = context.plan->pairs.empty() ? std::pair{static_cast<int>(row / n_views),
                                                                           static_cast<int>(row % n_views)}
                                                               : context.plan->pairs[row];
        const int column = context.view_to_light.empty() ? view : context.view_to_light[view];
        entries.push_back(static_cast<size_t>(light) * n_columns + column);
    }
    return entries;
}

std::vector<size_t> every_entry(size_t n) {
    std::vector<size_t> entries(n);
    std::iota(entries.begin(), entries.end(), size_t{0});
    return entries;
}

void add_scaled(const Matrix& from, double scale, Matrix& to) {
    for (size_t k = 0; k < to.values.size(); ++k) to.values[k] += scale * from.values[k];
}

double sum_of(const Matrix& m, const std::vector<size_t>& entries) {
    double sum = 0;
    for (const size_t k : entries) sum += m.values[k];
    return sum;
}

// g carried on by two samplings of the operator that take turns: K K from one sampling would hold the mean
// square of its noise (noise_bias.h), and the finer parts more of it.
struct Carried {
    Fields k1, k2;      // once
    Fields k2k1, k1k2;  // twice, if wanted
};
Carried carry(const LinkOperator& op1, const LinkOperator& op2, const Tile& tile, const Fields& g, bool twice,
              int average_to, int n_threads) {
    auto transported = [&](const LinkOperator& op, const Fields& x) {
        Fields y(x.n_unknowns(), x.n_columns());
        apply(op, x, y, n_threads);
        if (average_to > 0) average_parts(tile, average_to, n_threads, y);
        return y;
    };
    Carried carried;
    carried.k1 = transported(op1, g);
    carried.k2 = transported(op2, g);
    if (twice) {
        carried.k2k1 = transported(op2, carried.k1);
        carried.k1k2 = transported(op1, carried.k2);
    }
    return carried;
}

// Orders 2 and 3, or 2 to 5, of the light between facet parts: K, K1 K2, K1 K2 K1, K1 K2 K1 K2, each with the
// samplings exchanged as well, so that lights and views may be.
std::vector<Matrix> low_orders(const LinkOperator& op1, const LinkOperator& op2, const Tile& tile,
                               const Fields& lights, const Fields& views, bool same, int n_orders,
                               int average_to, int n_threads) {
    const bool twice = n_orders > 2;
    const Carried light = carry(op1, op2, tile, lights, twice, average_to, n_threads),
                  other = same ? Carried{} : carry(op1, op2, tile, views, twice, average_to, n_threads);
    const Carried& view = same ? light : other;
    std::vector<Matrix> orders(n_orders, Matrix(lights.n_columns(), views.n_columns()));
    auto add = [&](int order, const Combination& a, const Combination& b, double scale) {
        add_products(tile, a, b, scale, n_threads, orders[order - 2]);
    };
    // <a l, b v> and <b l, a v>, which are transposes of each other if the lights are the views.
    auto add_both_ways = [&](int order, const Fields Carried::*a, const Fields Carried::*b) {
        Matrix& sum = orders[order - 2];
        add(order, {{&(light.*a), 1}}, {{&(view.*b), 1}}, 0.5);
        if (!same) return add(order, {{&(light.*b), 1}}, {{&(view.*a), 1}}, 0.5);
        const Matrix one_way = sum;
        for (int i = 0; i < sum.rows; ++i)
            for (int j = 0; j < sum.columns; ++j) sum(i, j) += one_way(j, i);
    };
    add(2, {{&light.k1, 1}, {&light.k2, 1}}, {{&views, 1}}, 0.5);
    add_both_ways(3, &Carried::k1, &Carried::k2);
    if (!twice) return orders;
    add(4, {{&light.k2k1, 1}}, {{&view.k1, 1}}, 0.5);
    add(4, {{&light.k1k2, 1}}, {{&view.k2, 1}}, 0.5);
    add_both_ways(5, &Carried::k2k1, &Carried::k1k2);
    return orders;
}

MeshShare compare_grids(const Matrix& exact, const Matrix& coarse, const std::vector<size_t>& asked,
                        bool keep_pairs) {
    const double n = static_cast<double>(asked.size()), total = sum_of(coarse, asked);
    MeshShare share;
    if (keep_pairs) share.pairs = Matrix(exact.rows, exact.columns);
    if (!(total > 0)) return share;
    const double mean = sum_of(exact, asked) / total - 1;
    double spread = 0, differences = 0, totals = 0;
    for (const size_t k : asked) {
        const double difference = exact.values[k] - coarse.values[k],
                     relative = difference / std::max(coarse.values[k], 0.05 * total / n);
        spread += std::pow(relative - mean, 2) / n;
        differences += difference * difference;
        totals += coarse.values[k] * coarse.values[k];
        if (keep_pairs) share.pairs.values[k] = whole * relative;
    }
    share.correction = whole * mean;
    share.uncertainty = whole * (std::sqrt(spread) + 0.15 * std::abs(mean));
    share.typical = whole * std::sqrt(differences / totals);
    return share;
}

}  // namespace

double MeshShare::uncertainty_of(int light, int view, double lowest_cos) const {
    // Grazing light falls on crests alone, where irradiance varies most over a facet. Measured on two grids,
    // on the reliefs of tests/agreement/honest_surfaces.h, as shares of the rms over all pairs: 0.1 to 0.3
    // within 40 degrees, 0.1 to 1 at 60, 1.5 to 1.8 at 80.
    if (pairs.values.empty()) return uncertainty * (0.2 + 0.3 * (1 / std::max(lowest_cos, 0.1) - 1));
    // Measured against much longer runs of refinement 4, on the reliefs of tests/agreement/honest_surfaces.h:
    // 0.1 to 0.2 of the correction is left, and up to half where it is small.
    constexpr double left = 0.2;
    return left * std::hypot(pairs(light, view), typical);
}

MeshShare MeshBias::share_of_sum(double albedo, int max_order) const {
    if (!measured()) return {0, guess, {}, 0};
    const size_t last = exact.size() - 1,
                 n = max_order == 0 ? exact.size() : std::min<size_t>(exact.size(), max_order - 1);
    Matrix fine(exact[0].rows, exact[0].columns), rough = fine;
    double power = 1;
    for (size_t k = 0; k < n; ++k, power *= albedo) {
        add_scaled(exact[k], power, fine);
        add_scaled(coarse[k], power, rough);
    }
    const double x = std::min(0.9, albedo * ratio);
    if (max_order == 0 && x > 0) {
        // The orders beyond go on as the last two here, which may take turns between two walls.
        const double tail = power / albedo * x / (1 - x) / 2;
        for (const auto& [from, to] : {std::pair{&exact, &fine}, std::pair{&coarse, &rough}}) {
            add_scaled((*from)[last], tail, *to);
            add_scaled((*from)[last - 1], tail * ratio, *to);
        }
    }
    return compare_grids(fine, rough, asked, all_pairs);
}

MeshShare MeshBias::share_of_order(int order) const {
    if (!measured()) return {0, guess, {}, 0};
    const size_t k = std::min<size_t>(order - 2, exact.size() - 1);
    return compare_grids(exact[k], coarse[k], asked, all_pairs);
}

MeshBias predict_mesh_bias(const HeightField& surface) {
    // rms change of the gradient from one cell to the next, over the rms gradient; from a sample of rows.
    double change = 0, total = 0;
    const int step = std::max(1, surface.ny / 64);
    for (int j = 0; j < surface.ny; j += step)
        for (int i = 0; i < surface.nx; ++i) {
            const Gradient g = facet_gradient(surface, 0, i, j), right = facet_gradient(surface, 0, i + 1, j),
                           up = facet_gradient(surface, 0, i, j + 1);
            change += (std::pow(right.x - g.x, 2) + std::pow(right.y - g.y, 2) + std::pow(up.x - g.x, 2) +
                       std::pow(up.y - g.y, 2)) /
                      2;
            total += g.x * g.x + g.y * g.y;
        }
    if (!(total > 0)) return {};
    const double squared_roughness = change / total,
                 rms_slope =
                     std::sqrt(total / (static_cast<double>((surface.ny + step - 1) / step) * surface.nx));
    // rms over pairs of what two grids measure on Gaussian fields, slopes 0.3 to 3 and correlation lengths of
    // 2 to 12 cells, within 15 % (30 % at slope 0.3).
    MeshBias bias;
    bias.guess = 0.0225 * squared_roughness * rms_slope / std::sqrt(1 + rms_slope * rms_slope / 4);
    // Facets that differ as much as they tilt do not resolve the relief. Most such fields follow the guess,
    // too, but tiles with gaps of one cell had 3.7 times as much.
    if (squared_roughness > 0.5) bias.guess_caution = 12;
    return bias;
}

bool mesh_bias_is_predictable(const RunContext& context) {
    const HeightField& s = *context.surface;
    return s.nx * static_cast<long long>(s.ny) >= 1024 && context.grid->max_slope < 8;
}

MeshBias measure_mesh_bias(const RunContext& context, const RunSettings& settings, double falling,
                           int n_threads, const Monitor& monitor) {
    constexpr size_t most_directions = 64;
    const Tile tile = probe_tile(context, settings, 2 * settings.refinement);
    // Irradiance and both chains on both grids, never more than eight fields at once.
    auto fits = [&](size_t directions) {
        const double columns =
            static_cast<double>((directions + column_block - 1) / column_block * column_block);
        return 8 * 4.0 * columns * static_cast<double>(tile.n_unknowns()) <
               static_cast<double>(context.max_bytes);
    };
    if (!fits(1)) return predict_mesh_bias(*context.surface);
    const bool same = !context.view_to_light.empty();
    const size_t directions = context.lights.size() + (same ? 0 : context.views.size());
    MeshBias bias;
    bias.all_pairs = directions <= most_directions && fits(directions);
    const bool two_sided = bias.all_pairs && !same;
    const std::vector<Vec3> probes = bias.all_pairs ? context.lights : probe_directions(context);

    // Many directions: with few, single pairs are corrected by noise (N = 128, correlation length 2 cells,
    // target 0.1 %: the true error is 0.13 % with 256 or 512 directions and 0.06 % with 1024), and more on a
    // surface of so few facets that they average little.
    const int n_orders = falling > 0.5 ? 4 : 2;
    const double cells = static_cast<double>(context.surface->nx) * context.surface->ny;
    // Each direction lists the cells that its rays cross: about 200 bytes a cell of travel, which is as long
    // as the relief is high. A spike of 1e5 cells would take 10 GB.
    const double travel = std::clamp(static_cast<double>(context.grid->highest - context.grid->lowest), 1.0,
                                     max_march_travel),
                 most = std::max(256.0, 1e9 / (200 * travel));
    const int n_directions =
                  std::max(settings.directions,
                           static_cast<int>(std::min(most, std::clamp(4e6 / cells, 1024.0, 8192.0)))),
              n_places = static_cast<int>(std::clamp(16384 / cells, 1.0, 16.0));
    const double slope = context.grid->max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    const Irradiance irradiance = compute_irradiance(
        *context.grid, tile, probes, two_sided ? context.views : probes, !two_sided,
        shifted_sub_samples(n_places, 0.6, 0.3), {}, context.allow_skips, n_threads, monitor);
    auto half_of_the_directions = [&](double shift) {
        return build_link_operator(*context.grid, tile,
                                   slab_directions(n_directions / 2, z_max, 0.5, 0.25 + shift),
                                   shifted_sub_samples(n_directions / 2, 0.5, shift), n_threads, monitor);
    };
    const LinkOperator k1 = half_of_the_directions(0), k2 = half_of_the_directions(0.5);
    bias.exact = low_orders(k1, k2, tile, irradiance.lights, irradiance.view_fields(), !two_sided, n_orders,
                            0, n_threads);
    Fields lights = irradiance.lights, views = irradiance.views;
    average_parts(tile, settings.refinement, n_threads, lights);
    if (two_sided) average_parts(tile, settings.refinement, n_threads, views);
    bias.coarse = low_orders(k1, k2, tile, lights, two_sided ? views : lights, !two_sided, n_orders,
                             settings.refinement, n_threads);
    bias.asked = bias.all_pairs ? asked_entries(context, bias.exact[0].columns)
                                : every_entry(bias.exact[0].values.size());
    // Over two orders where that is known: light between two walls takes turns.
    const int apart = n_orders > 2 ? 2 : 1;
    const double last = sum_of(bias.coarse[n_orders - 1], bias.asked),
                 before = sum_of(bias.coarse[n_orders - 1 - apart], bias.asked);
    bias.ratio = before > 0 ? std::pow(last / before, 1.0 / apart) : 0.0;
    return bias;
}

}  // namespace gonio
