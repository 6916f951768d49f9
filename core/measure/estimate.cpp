#include "measure/estimate.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "measure/stage_average.h"

namespace gonio {
namespace {

// The first order of a row. A constant albedo scales it, a map's channels share
// its proportion.
double direct_part(const RunContext& context, const Stage& stage, size_t channel, size_t slices, size_t row) {
    const std::vector<double>& f = stage.f.mean();
    const size_t rows = context.rows();
    if (slices > 1) return f[(channel * slices + 1) * rows + row];
    const double direct = stage.direct.mean()[row];
    const Parameter& albedo = context.lambertian->albedo;
    if (!albedo.is_map()) return direct * albedo.constant[channel];
    return channel == 0 ? direct : f[row] > 0 ? direct / f[row] * f[channel * rows + row] : 0.0;
}

// What multiplies K at each order.
double albedo_of(const RunContext& context, size_t channel) {
    const Parameter& albedo = context.lambertian->albedo;
    return albedo.is_map() ? 1.0 : albedo.constant[channel];
}

double mean_albedo(const Parameter& albedo, size_t channel) {
    if (!albedo.is_map()) return albedo.constant[channel];
    const size_t n = static_cast<size_t>(albedo.map_nx) * albedo.map_ny;
    const auto first = albedo.map.begin() + static_cast<long>(channel * n);
    return std::accumulate(first, first + static_cast<long>(n), 0.0) / static_cast<double>(n);
}

// What the noise bias adds to one value, and the uncertainty of that (noise_bias.h). Slice 0 is the sum;
// single orders k >= 3 grow from order k - 2.
struct Noisy {
    double amount = 0, doubt = 0;
};
Noisy noise_of(const RunContext& context, const NoiseBias& noise, double ratio, const RowGroups& groups,
               size_t channel, size_t slice, size_t row, double direct, double indirect,
               double two_orders_below) {
    constexpr double doubt_of_higher = 0.15;
    const double albedo = albedo_of(context, channel), kappa = albedo * albedo * noise.kappa;
    if (slice == 1 || slice == 2) return {};
    if (slice >= 3) {
        const double amount = static_cast<double>(slice - 2) * kappa * two_orders_below;
        return {amount, noise.doubt * amount};
    }
    // Sum over j >= 1 of (j + 1) a^j c_j for orders that fall as x^j, and a little for dK K dK, which the two
    // factors of one sample do not cancel.
    const double x = std::min(0.9, albedo * ratio), higher = 1.15 * (2 - x) / (1 - x) * kappa * indirect;
    if (noise.pairs.values.empty())
        return {kappa * direct + higher, noise.doubt * kappa * direct + doubt_of_higher * higher};
    const Vec3 &light = context.lights[groups.light[row]], &view = context.views[groups.view[row]];
    const double pair = noise.pairs(groups.light[row], context.view_to_light[groups.view[row]]);
    return {albedo * albedo * albedo / pi * pair / (noise.core_area * light.z * view.z) + higher,
            doubt_of_higher * higher};
}

}  // namespace

double unresolved_share(double projected_ratio) {
    const double off = std::abs(projected_ratio - 1);
    return off > 0.05 ? std::min(off, 1.0) : 0.0;
}

Estimate make_estimate(const RunContext& context, const RowGroups& groups, const std::vector<Stage>& stages,
                       const MeshBias& mesh_bias, double skipped_bound) {
    const size_t rows = context.rows(), n_channels = context.n_channels(),
                 size = stages.back().f.mean().size();
    const size_t slices = size / (rows * n_channels);
    Estimate e;
    e.f.assign(size, 0.0);
    e.se = e.bias = e.hidden = e.f;

    std::vector<const Stage*> used;
    for (const Stage& s : stages)
        if (s.settings.refinement == stages.back().settings.refinement && s.f.mean().size() == size)
            used.push_back(&s);
    std::vector<std::vector<std::vector<double>>> se(used.size()),
        hidden(used.size());  // [stage][channel, slice][row]
    std::vector<double> weight(used.size());
    for (size_t s = 0; s < used.size(); ++s) {
        double pooled = 0;
        for (size_t slice = 0; slice < n_channels * slices; ++slice) {
            se[s].push_back(standard_errors(used[s]->f, slice * rows, groups));
            hidden[s].push_back(hidden_light(context, *used[s], slice));
            if (slice % slices == 0) pooled += pooled_doubt(*used[s], slice, se[s].back(), hidden[s].back());
        }
        weight[s] = 1 / std::max(pooled, 1e-30);
    }

    const double weights = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (size_t s = 0; s < used.size(); ++s) {
        const Stage& stage = *used[s];
        const double share = weight[s] / weights;
        for (size_t c = 0; c < n_channels; ++c) {
            for (size_t slice = 0; slice < slices; ++slice) {
                const MeshShare mesh =
                    slice >= 2 ? mesh_bias.share_of_order(static_cast<int>(slice))
                               : mesh_bias.share_of_sum(mean_albedo(context.lambertian->albedo, c),
                                                        context.max_order);
                for (size_t r = 0; r < rows; ++r) {
                    const size_t i = (c * slices + slice) * rows + r;
                    const double f = stage.f.mean()[i], direct = direct_part(context, stage, c, slices, r);
                    const double indirect = slice == 1 ? 0.0 : slice == 0 ? std::max(0.0, f - direct) : f;
                    const double below = slice >= 3 ? stage.f.mean()[i - 2 * rows] : 0.0;
                    const Noisy noisy = stage.noise ? noise_of(context, *stage.noise, stage.ratio, groups, c,
                                                               slice, r, direct, indirect, below)
                                                    : Noisy{};
                    const double left_out = slice == 0 ? stage.remainder * (direct + 2 * indirect) : 0.0;
                    const double skipped = slice == 0 ? skipped_bound * f : 0.0;
                    const int light = groups.light[r], view = context.view_to_light.empty()
                                                                  ? groups.view[r]
                                                                  : context.view_to_light[groups.view[r]];
                    const double cos_light = context.lights[groups.light[r]].z,
                                 cos_view = context.views[groups.view[r]].z;
                    const double unseen = hidden[s][c * slices + slice][r];
                    const double mesh_doubt =
                        mesh.uncertainty_of(light, view, std::min(cos_light, cos_view)) * indirect;
                    e.f[i] += share * (f - noisy.amount + mesh.correction_of(light, view) * indirect);
                    e.se[i] += std::pow(share * se[s][c * slices + slice][r], 2);
                    e.bias[i] += share * (std::hypot(mesh_doubt, noisy.doubt, left_out) + skipped + unseen);
                    e.hidden[i] += share * unseen;
                }
            }
        }
    }
    for (double& v : e.se) v = std::sqrt(v);

    // Limited orders, each corrected on its own: their sum is the sum.
    if (slices > 1 && context.max_order > 0)
        for (size_t c = 0; c < n_channels; ++c)
            for (size_t r = 0; r < rows; ++r) {
                double& sum = e.f[c * slices * rows + r];
                sum = 0;
                for (size_t slice = 1; slice < slices; ++slice) sum += e.f[(c * slices + slice) * rows + r];
            }

    const Parameter& albedo = context.lambertian->albedo;
    const std::vector<double>& values = albedo.constant;
    const size_t brightest =
        albedo.is_map()
            ? 0
            : static_cast<size_t>(std::max_element(values.begin(), values.end()) - values.begin());
    summarise(context, stages.back(), brightest, albedo.is_map() ? 1.0 : values[brightest], e);
    return e;
}

}  // namespace gonio
