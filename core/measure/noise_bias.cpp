#include "measure/noise_bias.h"

#include <algorithm>
#include <cmath>

namespace gonio {

NoiseBias noise_bias(const Tile& tile, const std::vector<const Fields*>& first, const Fields& irradiance,
                     double largest_albedo) {
    const int n = irradiance.n_columns(), runs = static_cast<int>(first.size());
    // mean_r <x_r, x_r> - mean_{r != s} <x_r, x_s> = 1 / (R - 1) sum_r <d_r, d_r> with d_r = x_r - mean.
    Matrix noise(n, n), start(n, n);
    for (int r = 0; r < runs; ++r) {
        Combination deviation;
        for (int s = 0; s < runs; ++s) deviation.push_back({first[s], (s == r ? 1.0 : 0.0) - 1.0 / runs});
        add_products(tile, deviation, deviation, 1.0 / (runs - 1), 1, noise);
    }
    const Combination g{{&irradiance, 1}};
    add_products(tile, g, g, 1.0, 1, start);
    double total_noise = 0, total = 0, spread = 0;
    for (size_t k = 0; k < noise.values.size(); ++k) {
        total_noise += noise.values[k];
        total += start.values[k];
    }
    if (!(total > 0)) return {};
    const double kappa = total_noise / total, mean = total / static_cast<double>(start.values.size());
    for (size_t k = 0; k < noise.values.size(); ++k)
        spread +=
            std::pow((noise.values[k] - kappa * start.values[k]) / std::max(start.values[k], 0.05 * mean),
                     2) /
            static_cast<double>(noise.values.size());
    const double albedo_squared = largest_albedo * largest_albedo;
    return {albedo_squared * kappa, albedo_squared * (std::sqrt(spread) + 0.3 * kappa)};
}

NoiseBias measure_noise_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                             const Monitor& monitor) {
    const Tile tile = probe_tile(context, settings, settings.refinement);
    const std::vector<Vec3> directions = probe_directions(context);
    const Irradiance irradiance =
        compute_irradiance(*context.grid, tile, directions, directions, true, {{0.6, 0.3}}, {},
                           context.skip_steep, n_threads, monitor);
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
    const double albedo = context.material->is_map() ? 0.5
                                                     : *std::max_element(context.material->albedo.begin(),
                                                                         context.material->albedo.end());
    return noise_bias(tile, {&first[0], &first[1]}, irradiance.lights, albedo);
}

}  // namespace gonio
