#include "measure/stage_average.h"

#include <algorithm>
#include <cmath>

namespace gonio {

Estimate average_stages(const MeasuredScene& scene, const std::vector<Stage>& stages) {
    const size_t rows = scene.rows(), size = stages.back().f.mean().size(),
                 slices = size / (rows * scene.n_channels());
    Estimate e;
    e.f.assign(size, 0.0);
    e.se = e.bias = e.hidden = e.f;
    double weights = 0;
    for (const Stage& stage : stages) {
        if (stage.settings.refinement != stages.back().settings.refinement || stage.f.mean().size() != size)
            continue;
        std::vector<double> variance, hidden;
        double pooled = 0;
        for (size_t slice = 0; slice < size / rows; ++slice) {
            const std::vector<double> se = standard_errors(stage.f, slice * rows, scene.groups),
                                      unseen = hidden_light(scene, stage, slice);
            for (const double s : se) variance.push_back(s * s);
            hidden.insert(hidden.end(), unseen.begin(), unseen.end());
            if (slice % slices == 0) pooled += pooled_doubt(stage, slice, se, unseen);
        }
        const double weight = 1 / std::max(pooled, 1e-30);
        weights += weight;
        for (size_t i = 0; i < size; ++i) {
            e.f[i] += weight * stage.f.mean()[i];
            e.se[i] += weight * weight * variance[i];
            e.hidden[i] += weight * hidden[i];
        }
    }
    for (double& f : e.f) f /= weights;
    for (double& se : e.se) se = std::sqrt(se) / weights;
    for (double& hidden : e.hidden) hidden /= weights;
    return e;
}

double pooled_doubt(const Stage& stage, size_t slice, const std::vector<double>& se,
                    const std::vector<double>& hidden) {
    const auto first = stage.f.mean().begin() + static_cast<long>(slice * se.size());
    const std::vector<double> scale = error_scale({first, first + static_cast<long>(se.size())});
    double pooled = 0;
    for (size_t r = 0; r < se.size(); ++r)
        if (scale[r] > 0) pooled += std::pow(se[r] / scale[r], 2) + std::pow(hidden[r] / scale[r], 2);
    return pooled;
}

std::vector<double> hidden_light(const MeasuredScene& scene, const Stage& stage, size_t slice) {
    std::vector<double> hidden(scene.rows(), 0.0);
    if (stage.settings.tiles_x > 0 || !scene.projected_area_is_known()) return hidden;
    for (size_t r = 0; r < hidden.size(); ++r) {
        const int light = scene.groups.light[r], view = scene.groups.view[r];
        const double lost = std::min(1.0, unresolved_share(stage.projected_lights.mean()[light]) +
                                              unresolved_share(stage.projected_views.mean()[view]));
        // f is at most 1 / (pi cos) on either side, as no facet gets more light than the beam carries.
        hidden[r] = lost * (lost < 1 ? stage.f.mean()[slice * hidden.size() + r]
                                     : 1 / (pi * std::max(scene.lights[light].z, scene.views[view].z)));
    }
    return hidden;
}

void summarise(const MeasuredScene& scene, const Stage& last, size_t channel, double unit_direct,
               Estimate& e) {
    const size_t rows = scene.rows(), n_channels = scene.n_channels(),
                 slices = e.f.size() / (rows * n_channels);
    double random = 0, systematic = 0, resolved = 0, direct = 0;
    const std::vector<double> direct_se = standard_errors(last.direct, 0, scene.groups);
    for (size_t c = 0; c < n_channels; ++c) {
        const size_t first = c * slices * rows;
        const auto begin = e.f.begin() + static_cast<long>(first);
        const std::vector<double> scale = error_scale({begin, begin + static_cast<long>(rows)});
        for (size_t r = 0; r < rows; ++r) {
            if (!(scale[r] > 0)) continue;
            random += std::pow(e.se[first + r] / scale[r], 2);
            systematic += std::pow(e.bias[first + r] / scale[r], 2);
            resolved += std::pow((e.bias[first + r] - e.hidden[first + r]) / scale[r], 2);
            if (c == channel) direct += std::pow(unit_direct * direct_se[r] / scale[r], 2);
        }
    }
    const double n = static_cast<double>(rows * n_channels);
    e.random = std::sqrt(random / n);
    e.systematic = std::sqrt(systematic / n);
    e.unresolved = e.systematic - std::sqrt(resolved / n);
    e.total = std::hypot(e.random, e.systematic);
    e.direct = std::sqrt(direct / static_cast<double>(rows));
}

}  // namespace gonio
