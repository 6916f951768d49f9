#include "measure/brdf.h"

#include "measure/brdf_scene.h"
#include "measure/describe.h"
#include "measure/measurement.h"
#include "measure/transport_choice.h"
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

BrdfResult empty_result(const Material& material, const BrdfPlan& plan) {
    BrdfResult result;
    result.table.incident = plan.incident;
    result.table.outgoing = plan.outgoing;
    result.table.pairs = plan.pairs;
    result.table.cells = plan.outgoing_cells;
    result.table.channels = material.channels;
    return result;
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
    const Lambertian* lambertian = pure_lambertian(material);
    const SimplifiedScene simple = simplify_brdf_scene(surface, material, options.allow_skips);
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
        const MeasuredScene scene = brdf_scene(simple, grid, plan, options);
        if (!scene.view_to_light.empty())
            report.skipped.push_back({"half of the directions", "lights and views are the same set"});
        TransportChoice choice = choose_transport(scene);
        report.settings = choice.report.settings;
        report.skipped.insert(report.skipped.end(), choice.report.skipped.begin(),
                              choice.report.skipped.end());
        measure_by_runs(scene, *choice.transport, options, monitor, result);
    }
    for (const auto& [key, value] : report.settings) result.table.provenance.push_back({key, value});
    return result;
}

}  // namespace gonio
