#include "measure/cell_views.h"

#include <algorithm>

namespace gonio {

int directions_per_cell(const RunSettings& settings) {
    return std::min(4 * settings.sub_samples, 64);
}

RunSettings settings_of_place(const RunSettings& settings) {
    RunSettings at_place = settings;
    at_place.sub_samples = std::max(1, 4 * settings.sub_samples / directions_per_cell(settings));
    return at_place;
}

int views_of_run(const MeasuredScene& scene, const RunSettings& settings) {
    return static_cast<int>(scene.views.size()) *
           (scene.plan->outgoing_cells.empty() ? 1 : directions_per_cell(settings));
}

void look_into_cells(MeasuredScene& scene, int per_cell, const RunShifts& shifts) {
    const std::vector<ReceiverCell>& cells = scene.plan->outgoing_cells;
    scene.views.clear();
    for (const ReceiverCell& cell : cells)
        for (const SubSample& place : shifted_sub_samples(per_cell, shifts(32), shifts(33))) {
            Vec3 d = direction_in(cell, place.a, place.b);
            if (scene.axes_swapped) std::swap(d.x, d.y);
            scene.views.push_back(d);
        }
    scene.view_to_light.clear();
    scene.groups = {};
    scene.groups.n_lights = static_cast<int>(scene.lights.size());
    scene.groups.n_views = static_cast<int>(scene.views.size());
    for (int l = 0; l < scene.groups.n_lights; ++l)
        for (int v = 0; v < scene.groups.n_views; ++v) {
            scene.groups.light.push_back(l);
            scene.groups.view.push_back(v);
        }
}

void average_cells(RunValues& values, int per_cell) {
    auto average = [&](std::vector<float>& of) {
        std::vector<float> means;
        for (size_t first = 0; first < of.size(); first += per_cell) {
            double sum = 0;
            for (int k = 0; k < per_cell; ++k) sum += of[first + k];
            means.push_back(static_cast<float>(sum / per_cell));
        }
        of = std::move(means);
    };
    average(values.f);  // [channel][slice][light][cell][direction]
    average(values.direct);
    average(values.projected_views);
}

}  // namespace gonio
