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
    return {0, 0.014 * std::pow(roughness, 1.5), false};
}

MeshBias measure_mesh_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                           const Monitor& monitor) {
    constexpr int most_directions = 16;
    std::vector<Vec3> chosen, all = context.lights;
    if (context.view_to_light.empty()) all.insert(all.end(), context.views.begin(), context.views.end());
    const size_t n = std::min<size_t>(most_directions, all.size());
    for (size_t k = 0; k < n; ++k) chosen.push_back(all[(2 * k + 1) * all.size() / (2 * n)]);

    RunSettings fine = settings;
    fine.refinement = 2 * settings.refinement;
    fine.sub_samples = 1;
    fine.directions = std::max(64, settings.directions);
    const HeightField& s = *context.surface;
    const int width = std::min(s.nx, tile_core), height = std::min(s.ny, tile_core);
    const bool whole = settings.tiles_x == 0 && width == s.nx && height == s.ny;
    const int halo_x = whole ? 0 : std::min(tile_halo, (s.nx - width) / 2),
              halo_y = whole ? 0 : std::min(tile_halo, (s.ny - height) / 2);
    const CellRect area{wrap_index((s.nx - width) / 2 - halo_x, s.nx),
                        wrap_index((s.ny - height) / 2 - halo_y, s.ny), width + 2 * halo_x,
                        height + 2 * halo_y};
    const Tile tile = make_tile(s, area, {halo_x, halo_y, width, height}, fine.refinement);

    const double z_max =
        context.grid->max_slope / std::sqrt(1 + context.grid->max_slope * context.grid->max_slope);
    const DirectionSet set = slab_directions(fine.directions, z_max, 0.5, 0.25);
    std::vector<SubSample> jitter;
    for (int k = 0; k < fine.directions; ++k)
        jitter.push_back(
            {fractional_part(0.5 + k * 0.7548776662466927), fractional_part(0.5 + k * 0.5698402909980532)});
    Irradiance irradiance = compute_irradiance(*context.grid, tile, chosen, chosen, true, {{0.6, 0.3}}, {},
                                               context.skip_steep, n_threads, monitor);
    const LinkOperator op = build_link_operator(*context.grid, tile, set, jitter, n_threads, monitor);
    SeriesOptions options;
    options.tolerance = 1e-3;
    options.max_order = context.max_order;
    // A map's mean would do, but the bias relative to the indirect part hardly depends on the albedo.
    const double albedo = context.material->is_map() ? 0.5
                                                     : *std::max_element(context.material->albedo.begin(),
                                                                         context.material->albedo.end());
    options.largest_albedo = albedo;
    auto indirect = [&](int average_to) {
        SeriesOptions o = options;
        o.average_to = average_to;
        const OrderSeries series = diffuse_series(op, tile, irradiance.lights, irradiance.lights, true,
                                                  nullptr, o, n_threads, monitor);
        Matrix sum(static_cast<int>(n), static_cast<int>(n));
        double power = 1;
        for (const Matrix& order : series.higher) {
            power *= albedo;
            for (size_t k = 0; k < sum.values.size(); ++k) sum.values[k] += power * order.values[k];
        }
        return sum;
    };
    const Matrix exact = indirect(0);
    average_parts(tile, settings.refinement, n_threads, irradiance.lights);
    const Matrix coarse = indirect(settings.refinement);

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
    bias.uncertainty = 4.0 / 3 * std::sqrt(spread) + 0.3 * std::abs(bias.correction);
    return bias;
}

}  // namespace gonio
