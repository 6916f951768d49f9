#include "measure/brdf_scene.h"

#include <map>

namespace gonio {
namespace {

// views[v] == lights[view_to_light[v]], if the two sets are equal; else empty.
std::vector<int> match_views(const BrdfPlan& plan) {
    if (plan.incident.size() != plan.outgoing.size()) return {};
    std::map<std::pair<double, double>, int> light_of;
    for (size_t l = 0; l < plan.incident.size(); ++l)
        light_of[{plan.incident[l].theta_deg, plan.incident[l].phi_deg}] = static_cast<int>(l);
    std::vector<int> found;
    for (const AnglesDeg& v : plan.outgoing) {
        const auto at = light_of.find({v.theta_deg, v.phi_deg});
        if (at == light_of.end()) return {};
        found.push_back(at->second);
    }
    if (light_of.size() != found.size()) return {};
    return found;
}

std::vector<Vec3> vectors_of(const std::vector<AnglesDeg>& angles, bool axes_swapped) {
    std::vector<Vec3> list;
    for (const AnglesDeg& a : angles) {
        Vec3 d = to_vector(a);
        if (axes_swapped) std::swap(d.x, d.y);
        list.push_back(d);
    }
    return list;
}

RowGroups row_groups(const BrdfPlan& plan) {
    RowGroups groups;
    groups.n_lights = static_cast<int>(plan.incident.size());
    groups.n_views = static_cast<int>(plan.outgoing.size());
    for (const auto& [light, view] : plan.pairs) {
        groups.light.push_back(light);
        groups.view.push_back(view);
    }
    if (plan.pairs.empty())
        for (int light = 0; light < groups.n_lights; ++light)
            for (int view = 0; view < groups.n_views; ++view) {
                groups.light.push_back(light);
                groups.view.push_back(view);
            }
    return groups;
}

}  // namespace

SimplifiedScene simplify_brdf_scene(const HeightField& surface, const Material& material, bool allow_skips) {
    const Lambertian* lambertian = pure_lambertian(material);
    return simplify_scene(
        surface,
        lambertian ? Material(material.channels,
                              Lambertian{lambertian->albedo.for_channels(material.channels.size())})
                   : material,
        allow_skips);
}

MeasuredScene brdf_scene(const SimplifiedScene& simple, const MarchGrid& grid, const BrdfPlan& plan,
                         const RunOptions& options) {
    MeasuredScene scene;
    scene.surface = &simple.surface;
    scene.grid = &grid;
    scene.material = &simple.material;
    scene.plan = &plan;
    scene.lights = vectors_of(plan.incident, simple.axes_swapped);
    scene.views = vectors_of(plan.outgoing, simple.axes_swapped);
    scene.groups = row_groups(plan);
    scene.axes_swapped = simple.axes_swapped;
    scene.allow_skips = options.allow_skips;
    // Two runs fit side by side. A share by threads would cut a job differently on other machines.
    scene.max_bytes = static_cast<long long>(0.4 * static_cast<double>(options.max_bytes));
    if (options.allow_skips && plan.outgoing_cells.empty()) scene.view_to_light = match_views(plan);
    return scene;
}

}  // namespace gonio
