#include "measure/mesh_bias.h"

#include <algorithm>
#include <cmath>

#include "surface/facet_mesh.h"

namespace gonio {

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
    const double roughness = total > 0 ? std::sqrt(change / total) : 0;
    return {0, 0.007 * std::pow(roughness, 1.5), false};
}

MeshBias measure_mesh_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                           const Monitor& monitor) {
    const std::vector<Vec3> chosen = probe_directions(context);
    const size_t n = chosen.size();

    // Many directions: with few the probe would see its own noise (at 128, spread 3.1e-4 instead of 1.4e-4).
    const int refinement = 2 * settings.refinement, n_directions = std::max(1024, settings.directions);
    const Tile tile = probe_tile(context, settings, refinement);
    const double z_max =
        context.grid->max_slope / std::sqrt(1 + context.grid->max_slope * context.grid->max_slope);
    const DirectionSet set = slab_directions(n_directions, z_max, 0.5, 0.25);
    const Irradiance irradiance = compute_irradiance(*context.grid, tile, chosen, chosen, true, {{0.6, 0.3}},
                                                     {}, context.skip_steep, n_threads, monitor);
    const LinkOperator op = build_link_operator(
        *context.grid, tile, set, shifted_sub_samples(n_directions, 0.5, 0.5), n_threads, monitor);
    // The second order alone: it is linear in K. Higher ones would compare how noisy the two operators are
    // (noise_bias.h).
    auto second_order = [&](const Fields& g) {
        Fields once(g.n_unknowns(), g.n_columns());
        apply(op, g, once, n_threads);
        Matrix sum(static_cast<int>(n), static_cast<int>(n));
        add_products(tile, {{&g, 1}}, {{&once, 1}}, 1.0, n_threads, sum);
        return sum;
    };
    Fields averaged = irradiance.lights;
    average_parts(tile, settings.refinement, n_threads, averaged);
    const Matrix exact = second_order(irradiance.lights), coarse = second_order(averaged);

    double difference = 0, total = 0, spread = 0;
    for (size_t k = 0; k < exact.values.size(); ++k) {
        difference += exact.values[k] - coarse.values[k];
        total += coarse.values[k];
    }
    MeshBias bias;
    bias.measured = true;
    if (!(total > 0)) return bias;
    const double mean = difference / total, mean_value = total / static_cast<double>(exact.values.size());
    for (size_t k = 0; k < exact.values.size(); ++k) {
        const double relative = (exact.values[k] - coarse.values[k] - mean * coarse.values[k]) /
                                std::max(coarse.values[k], 0.05 * mean_value);
        spread += relative * relative / static_cast<double>(exact.values.size());
    }
    // Error falls with the square of the part's size: half the size leaves a quarter, so the whole error is
    // 4/3 of the difference.
    bias.correction = 4.0 / 3 * mean;
    bias.uncertainty = 4.0 / 3 * std::sqrt(spread) + 0.15 * std::abs(bias.correction);
    return bias;
}

}  // namespace gonio
