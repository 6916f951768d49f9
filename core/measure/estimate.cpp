#include "measure/estimate.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace gonio {
namespace {

std::vector<double> part(const std::vector<double>& values, size_t first, size_t n) {
    return {values.begin() + static_cast<long>(first), values.begin() + static_cast<long>(first + n)};
}

// The first order of a row. Runs keep it for channel 0; a constant albedo scales it, a map's channels share
// its proportion.
double direct_part(const RunContext& context, const Stage& stage, size_t channel, size_t slices, size_t row) {
    const std::vector<double>& f = stage.f.mean();
    const size_t rows = context.rows();
    if (slices > 1) return f[(channel * slices + 1) * rows + row];
    const double direct = stage.direct.mean()[row], value = f[channel * rows + row];
    if (channel == 0) return direct;
    const Lambertian& m = *context.material;
    if (!m.is_map()) return m.albedo[0] > 0 ? direct * m.albedo[channel] / m.albedo[0] : value;
    return f[row] > 0 ? direct / f[row] * value : 0.0;
}

// NoiseBias is that of the largest albedo.
double kappa_of_channel(const RunContext& context, const Stage& stage, size_t channel) {
    const Lambertian& m = *context.material;
    const double kappa = stage.noise ? stage.noise->kappa : 0.0;
    if (m.is_map()) return kappa;
    return kappa * std::pow(m.albedo[channel] / *std::max_element(m.albedo.begin(), m.albedo.end()), 2);
}

}  // namespace

Estimate make_estimate(const RunContext& context, const RowGroups& groups, const std::vector<Stage>& stages,
                       const MeshBias& mesh_bias, double skipped_bound) {
    const size_t rows = context.rows(), n_channels = context.n_channels(),
                 size = stages.back().f.mean().size();
    const size_t slices = size / (rows * n_channels);
    Estimate e;
    e.f.assign(size, 0.0);
    e.se = e.bias = e.f;

    std::vector<const Stage*> used;
    for (const Stage& s : stages)
        if (s.settings.refinement == stages.back().settings.refinement && s.f.mean().size() == size)
            used.push_back(&s);
    std::vector<std::vector<std::vector<double>>> se(used.size());  // [stage][channel, slice][row]
    std::vector<double> weight(used.size());
    for (size_t s = 0; s < used.size(); ++s) {
        double pooled = 0;
        for (size_t slice = 0; slice < n_channels * slices; ++slice) {
            se[s].push_back(standard_errors(used[s]->f, slice * rows, groups));
            if (slice % slices != 0) continue;
            const std::vector<double> scale = error_scale(part(used[s]->f.mean(), slice * rows, rows));
            for (size_t r = 0; r < rows; ++r)
                if (scale[r] > 0) pooled += std::pow(se[s].back()[r] / scale[r], 2);
        }
        weight[s] = 1 / std::max(pooled, 1e-30);
    }

    const double weights = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (size_t s = 0; s < used.size(); ++s) {
        const Stage& stage = *used[s];
        const double share = weight[s] / weights;
        const double noise_doubt =
            stage.noise && stage.noise->kappa > 0 ? stage.noise->uncertainty / stage.noise->kappa : 0.0;
        for (size_t c = 0; c < n_channels; ++c) {
            const double kappa = kappa_of_channel(context, stage, c);
            for (size_t slice = 0; slice < slices; ++slice)
                for (size_t r = 0; r < rows; ++r) {
                    const size_t i = (c * slices + slice) * rows + r;
                    const double f = stage.f.mean()[i], direct = direct_part(context, stage, c, slices, r);
                    const double indirect = slice == 1 ? 0.0 : slice == 0 ? std::max(0.0, f - direct) : f;
                    // What the noise bias adds (noise_bias.h) to the sum, and to single orders k >= 3.
                    const double noisy =
                        kappa * (slice == 0   ? direct + 2 * indirect
                                 : slice >= 3 ? static_cast<double>(slice - 2) * stage.f.mean()[i - 2 * rows]
                                              : 0.0);
                    const double continued =
                        slice == 0 ? series_continuation_error * stage.remainder * direct : 0.0;
                    const double skipped = slice == 0 ? skipped_bound * f : 0.0;
                    e.f[i] += share * (f - noisy + mesh_bias.correction * indirect);
                    e.se[i] += std::pow(share * se[s][c * slices + slice][r], 2);
                    e.bias[i] += share * (std::hypot(mesh_bias.uncertainty * indirect, noise_doubt * noisy,
                                                     continued) +
                                          skipped);
                }
        }
    }
    for (double& v : e.se) v = std::sqrt(v);

    double random = 0, systematic = 0, direct = 0;
    const std::vector<double> direct_se = standard_errors(stages.back().direct, 0, groups);
    for (size_t c = 0; c < n_channels; ++c) {
        const size_t first = c * slices * rows;
        const std::vector<double> scale = error_scale(part(e.f, first, rows));
        for (size_t r = 0; r < rows; ++r) {
            if (!(scale[r] > 0)) continue;
            random += std::pow(e.se[first + r] / scale[r], 2);
            systematic += std::pow(e.bias[first + r] / scale[r], 2);
            if (c == 0) direct += std::pow(direct_se[r] / scale[r], 2);
        }
    }
    const double n = static_cast<double>(rows * n_channels);
    e.random = std::sqrt(random / n);
    e.systematic = std::sqrt(systematic / n);
    e.total = std::hypot(e.random, e.systematic);
    e.direct = std::sqrt(direct / static_cast<double>(rows));
    return e;
}

}  // namespace gonio
