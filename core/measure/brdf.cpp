#include "measure/brdf.h"

#include <algorithm>
#include <map>

#include "measure/describe.h"
#include "measure/measurement.h"
#include "measure/simplify.h"
#include "visibility/curvature.h"

namespace gonio {
namespace {

// f(channel, row): of one order alone.
template <class Value>
void fill_exact(const BrdfPlan& plan, Value&& f, BrdfResult& result) {
    Table& table = result.table;
    table.orders = plan.separate_orders ? std::max(1, plan.max_order) : 0;
    const size_t n = table.channels.size() * table.slices() * table.rows();
    table.f.assign(n, 0.0f);
    table.se.assign(n, 0.0f);
    table.bias.assign(n, 0.0f);
    for (size_t c = 0; c < table.channels.size(); ++c)
        for (size_t slice = 0; slice < std::min<size_t>(2, table.slices()); ++slice)
            for (size_t row = 0; row < table.rows(); ++row)
                table.f[table.index(c, slice, row)] = static_cast<float>(f(c, row));
    result.report.settings.push_back({"transport", "closed form"});
}

MarchGrid checked_march_grid(const HeightField& s, long long max_bytes) {
    const double grid_bytes = static_cast<double>(s.nx) * s.ny * 4 * 8;
    if (grid_bytes > 0.8 * static_cast<double>(max_bytes))
        throw Error(ErrorCode::limit, "/surface", std::to_string(s.nx) + " x " + std::to_string(s.ny),
                    "needs " + number(grid_bytes / 1e9) + " GB of " +
                        number(static_cast<double>(max_bytes) / 1e9) + " GB; crop or resample it");
    return make_march_grid(s);
}

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

BrdfResult empty_result(const Material& material, const BrdfPlan& plan) {
    BrdfResult result;
    result.table.incident = plan.incident;
    result.table.outgoing = plan.outgoing;
    result.table.pairs = plan.pairs;
    result.table.cells = plan.outgoing_cells;
    result.table.channels = material.channels;
    return result;
}

RowGroups row_groups(const Table& table) {
    RowGroups groups;
    for (size_t r = 0; r < table.rows(); ++r) {
        groups.light.push_back(table.pair(r).first);
        groups.view.push_back(table.pair(r).second);
    }
    groups.n_lights = static_cast<int>(table.incident.size());
    groups.n_views = static_cast<int>(table.outgoing.size());
    return groups;
}

}  // namespace

BrdfResult measure_brdf(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                        const RunOptions& options, const Monitor& monitor) {
    validate(material, surface.nx, surface.ny);
    check_base(surface);
    if (plan.incident.empty() || plan.outgoing.empty())
        throw Error(ErrorCode::invalid_input, "/measure", "",
                    "needs at least one incident and one outgoing direction");
    BrdfResult result = empty_result(material, plan);
    Report& report = result.report;
    // Of Lambertian facets, whatever they were written as, an albedo for each channel.
    const Lambertian* lambertian = pure_lambertian(material);
    const SimplifiedScene simple = simplify_scene(
        surface,
        lambertian ? Material(material.channels,
                              Lambertian{lambertian->albedo.for_channels(material.channels.size())})
                   : material,
        options.allow_skips);
    report.skipped = simple.skipped;
    if (options.allow_skips && is_plane(simple.surface) && !has_maps(simple.material) && lambertian) {
        report.skipped.push_back({"all tracing", "the surface is a plane: f = albedo / pi exactly"});
        const Parameter& albedo = pure_lambertian(simple.material)->albedo;
        fill_exact(
            plan, [&](size_t c, size_t) { return albedo.constant[c] / pi; }, result);
    } else if (options.allow_skips && lambertian && lambertian->albedo.range().second == 0) {
        report.skipped.push_back({"all tracing", "the surface is black"});
        fill_exact(
            plan, [](size_t, size_t) { return 0.0; }, result);
    } else {
        const MarchGrid grid = checked_march_grid(simple.surface, options.max_bytes);
        MeasuredScene scene;
        scene.surface = &simple.surface;
        scene.grid = &grid;
        scene.material = &simple.material;
        scene.plan = &plan;
        scene.lights = vectors_of(plan.incident, simple.axes_swapped);
        scene.views = vectors_of(plan.outgoing, simple.axes_swapped);
        scene.groups = row_groups(result.table);
        scene.axes_swapped = simple.axes_swapped;
        scene.allow_skips = options.allow_skips;
        // Two runs fit side by side. A share by threads would cut a job differently on other machines.
        scene.max_bytes = static_cast<long long>(0.4 * static_cast<double>(options.max_bytes));
        if (options.allow_skips && plan.outgoing_cells.empty()) scene.view_to_light = match_views(plan);
        if (!scene.view_to_light.empty())
            report.skipped.push_back({"half of the directions", "lights and views are the same set"});
        const std::unique_ptr<Transport> transport = make_transport(scene, report);
        measure_by_runs(scene, *transport, options, monitor, result);
    }
    for (const auto& [key, value] : report.settings) result.table.provenance.push_back({key, value});
    return result;
}

}  // namespace gonio
