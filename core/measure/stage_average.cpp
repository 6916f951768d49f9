#include "measure/stage_average.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace gonio {

Estimate average_stages(const MeasuredScene& scene, const std::vector<Stage>& stages) {
    const size_t rows = scene.rows(), size = stages.back().f.mean().size(),
                 slices = size / (rows * scene.n_channels());
    Estimate e;
    e.f.assign(size, 0.0);
    e.se = e.bias = e.f;
    double weights = 0;
    for (const Stage& stage : stages) {
        if (stage.settings.refinement != stages.back().settings.refinement || stage.f.mean().size() != size)
            continue;
        std::vector<double> variance;
        double pooled = 0;
        for (size_t slice = 0; slice < size / rows; ++slice) {
            const std::vector<double> se = standard_errors(stage.f, slice * rows, scene.groups);
            for (const double s : se) variance.push_back(s * s);
            if (slice % slices != 0) continue;
            const auto first = stage.f.mean().begin() + static_cast<long>(slice * rows);
            const std::vector<double> scale = error_scale({first, first + static_cast<long>(rows)});
            for (size_t r = 0; r < rows; ++r)
                if (scale[r] > 0) pooled += std::pow(se[r] / scale[r], 2);
        }
        const double weight = 1 / std::max(pooled, 1e-30);
        weights += weight;
        for (size_t i = 0; i < size; ++i) {
            e.f[i] += weight * stage.f.mean()[i];
            e.se[i] += weight * weight * variance[i];
        }
    }
    for (double& f : e.f) f /= weights;
    for (double& se : e.se) se = std::sqrt(se) / weights;
    return e;
}

std::vector<double> unresolved_rows(const MeasuredScene& scene, const Stage& stage) {
    std::vector<double> share(scene.rows(), 0.0);
    if (stage.settings.tiles_x > 0 || !scene.projected_area_is_known()) return share;
    for (size_t r = 0; r < share.size(); ++r)
        share[r] = std::min(1.0, unresolved_share(stage.projected_lights.mean()[scene.groups.light[r]]) +
                                     unresolved_share(stage.projected_views.mean()[scene.groups.view[r]]));
    return share;
}

void summarise(const MeasuredScene& scene, const Stage& last, Estimate& e) {
    const size_t rows = scene.rows(), n_channels = scene.n_channels(),
                 slices = e.f.size() / (rows * n_channels);
    double random = 0, systematic = 0, direct = 0;
    const std::vector<double> direct_se = standard_errors(last.direct, 0, scene.groups);
    for (size_t c = 0; c < n_channels; ++c) {
        const size_t first = c * slices * rows;
        const auto begin = e.f.begin() + static_cast<long>(first);
        const std::vector<double> scale = error_scale({begin, begin + static_cast<long>(rows)});
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
}

}  // namespace gonio
