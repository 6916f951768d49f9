#include "measure/noise_bias.h"

#include <algorithm>
#include <cmath>

#include "measure/windows.h"

namespace gonio {

NoiseBias noise_bias(const Tile& tile, const std::vector<const Fields*>& first, const Fields& irradiance,
                     bool keep_pairs, int n_threads) {
    const int n = irradiance.n_columns(), all = first[0]->n_columns(), runs = static_cast<int>(first.size());
    // mean_r <x_r, x_r> - mean_{r != s} <x_r, x_s> = 1 / (R - 1) sum_r <d_r, d_r> with d_r = x_r - mean.
    Matrix noise(all, all), start(n, n);
    for (int r = 0; r < runs; ++r) {
        Combination deviation;
        for (int s = 0; s < runs; ++s) deviation.push_back({first[s], (s == r ? 1.0 : 0.0) - 1.0 / runs});
        add_products(tile, deviation, deviation, 1.0 / (runs - 1), n_threads, noise);
    }
    const Combination g{{&irradiance, 1}};
    add_products(tile, g, g, 1.0, n_threads, start);
    // A direction with itself stands out, and is no pair of the table unless lights are views.
    std::vector<std::pair<int, int>> entries;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
            if (i != j || keep_pairs || n == 1) entries.emplace_back(i, j);
    const double n_entries = static_cast<double>(entries.size());
    double total_noise = 0, total = 0, spread = 0;
    for (const auto& [i, j] : entries) {
        total_noise += noise(i, j);
        total += start(i, j);
    }
    if (!(total > 0 && total_noise > 0)) return {};
    NoiseBias bias;
    bias.kappa = total_noise / total;
    for (const auto& [i, j] : entries)
        spread += std::pow((noise(i, j) / bias.kappa - start(i, j)) /
                               std::max(start(i, j), 0.05 * total / n_entries),
                           2) /
                  n_entries;
    bias.doubt = std::sqrt(spread);
    bias.core_area = tile.core_area();
    if (keep_pairs) bias.pairs = std::move(noise);
    return bias;
}

NoiseBias measure_noise_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                             const Monitor& monitor) {
    const Tile tile = probe_tile(context, settings, settings.refinement);
    const std::vector<Vec3> directions = probe_directions(context);
    const Irradiance irradiance =
        compute_irradiance(*context.grid, tile, directions, directions, true, {{0.6, 0.3}}, {},
                           context.allow_skips, n_threads, monitor);
    const double z_max =
        context.grid->max_slope / std::sqrt(1 + context.grid->max_slope * context.grid->max_slope);
    std::vector<Fields> first;
    for (const double shift : {0.13, 0.62}) {
        const DirectionSet set =
            slab_directions(settings.directions, z_max, shift, fractional_part(3.7 * shift));
        const LinkOperator op =
            build_link_operator(*context.grid, tile, set,
                                shifted_sub_samples(settings.directions, fractional_part(7.3 * shift), shift),
                                n_threads, monitor);
        first.emplace_back(tile.n_unknowns(), irradiance.lights.n_columns());
        apply(op, irradiance.lights, first.back(), n_threads);
    }
    return noise_bias(tile, {&first[0], &first[1]}, irradiance.lights, false, n_threads);
}

}  // namespace gonio
