#include "measure/forecast.h"

#include <algorithm>
#include <cmath>

#include "material/lobe_shape.h"
#include "measure/cell_views.h"
#include "measure/graph_run.h"
#include "measure/mesh_bias.h"
#include "measure/planning.h"
#include "measure/windows.h"
#include "scattering/slot_material.h"

namespace gonio {
namespace {

// Of which most figures were measured.
constexpr double usual_facets = 2 * 128 * 128, usual_slope = 0.5, usual_cells = 64;

// How a family of lobes differs from GGX: seconds for one value of the direct term and, in a row of values,
// of the pair graph, beyond those of GGX; errors of the two, where short tails leave sharper edges, or less
// light is passed on.
struct Family {
    double direct_seconds, row_seconds, direct_error, indirect_error;
};
struct FamilyOf {
    Family operator()(const Lambertian&) const { return {0.3e-9, 0, 1, 1}; }
    Family operator()(const Phong&) const { return {4e-9, 1.5e-9, 1.6, 0.14}; }
    Family operator()(const BlinnPhong&) const { return {2.6e-9, 1.6e-9, 2.5, 0.1}; }
    Family operator()(const Microfacet& lobe) const {
        return lobe.distribution == Microfacet::Distribution::ggx ? Family{0.45e-9, 0, 1, 1}
                                                                  : Family{2.6e-9, 12e-9, 1.6, 2.2};
    }
    Family operator()(const CoatedDiffuse&) const { return {1e-9, 4e-9, 1.5, 4}; }
    Family operator()(const Mirror&) const { return {0, 0, 1, 1}; }
};

struct Scene {
    double facets, slope, lights, views, cells, places;  // cells: 0 for point directions
    double sub_samples;                                  // at each place
    bool same, indirect;

    Scene(const MeasuredScene& scene, const RunSettings& settings)
        : facets(2 * worked_cells(scene, settings) * settings.refinement * settings.refinement),
          slope(std::clamp(rms_slope(*scene.surface), 0.05, 3.0)),
          lights(static_cast<double>(scene.lights.size())),
          views(views_of_run(scene, settings)),
          cells(static_cast<double>(scene.plan->outgoing_cells.size())),
          places(directions_per_cell(settings)),
          sub_samples(scene.plan->outgoing_cells.empty() ? settings.sub_samples
                                                         : settings_of_place(settings).sub_samples),
          same(!scene.view_to_light.empty()),
          indirect(scene.grid->max_slope > 0 && scene.plan->max_order != 1) {}

    double sides() const { return same ? lights : lights + views; }
    double few_facets() const { return std::sqrt(usual_facets / facets); }
    // Cells are seen from few places: the smaller they are, the less f varies inside.
    double error_in_cells(double width) const {
        return 0.027 * std::pow(width / 0.3 * slope / usual_slope, -0.7) * std::pow(places / 4, -0.6) *
               std::pow(usual_cells / cells, 0.42);
    }
};

// Windows see different parts of the relief: six leave 0.75 % at slope 0.7.
double of_windows(const Scene& s, const RunSettings& settings) {
    return settings.tiles_x == 0 ? 0.0
                                 : 0.0075 * std::sqrt(6.0) * s.slope / 0.7 /
                                       std::sqrt(static_cast<double>(settings.tiles_x) * settings.tiles_y);
}

}  // namespace

RunForecast forecast_diffuse(const MeasuredScene& scene, const RunSettings& settings) {
    constexpr double per_facet = 1.2e-6, per_side = 12e-9, per_shared = 30e-9;
    const Scene s(scene, settings);
    const double parts = settings.refinement * settings.refinement, directions = settings.directions;
    RunForecast run;
    run.cpu_seconds =
        s.facets * (per_facet + per_side * s.sides() * s.sub_samples + per_shared * directions / parts);
    // Two grids, where a guess does not do, are the price of more runs than there are.
    const MeshBias mesh = predict_mesh_bias(*scene.surface);
    const double target = scene.plan->accuracy.target();
    if (s.indirect && target > 0 &&
        mesh.guess * mesh.guess_caution * reflected_share(*scene.material) > target)
        run.cpu_seconds *= 2.5;
    run.direct = s.cells > 0 ? 0.6 * s.error_in_cells(0.5)
                             : 0.0027 * s.slope / 0.7 * s.few_facets() * std::pow(s.sub_samples, -0.8);
    run.direct = std::hypot(run.direct, of_windows(s, settings));
    if (s.indirect)
        run.indirect =
            0.0184 * std::pow(s.slope / 0.7, 1.5) * s.few_facets() * std::pow(directions / 16, -1.7);
    return run;
}

RunForecast forecast_graph(const MeasuredScene& scene, const RunSettings& settings) {
    const Scene s(scene, settings);
    const double parts = settings.refinement * settings.refinement,
                 groups = static_cast<double>(channel_groups(*scene.material).size()),
                 values = s.facets * s.lights * s.views * (s.same ? 0.5 : 1.0);
    double rays = s.facets * settings.directions / 9 / parts,
           pairs = s.indirect ? rays * share_that_hits(s.slope) : 0.0;
    const double total_share = reflected_share(*scene.material);
    double per_value = 0, per_row = 0, direct = 0, indirect = 0;
    for (const WeightedLobe& part : scene.material->lobes) {
        const Family family = std::visit(FamilyOf{}, part.lobe);
        per_value += family.direct_seconds;
        per_row += family.row_seconds;
        Material alone = *scene.material;
        alone.lobes = {part};
        for (const LobeShape& shape : lobe_shapes(alone)) {
            const double share = shape.share / total_share, width = std::max(shape.width, 1e-3);
            const double of_lobe = s.cells > 0
                                       ? s.error_in_cells(width)
                                       : 2.8e-4 / width * s.few_facets() * std::pow(s.sub_samples, -0.6);
            direct = std::hypot(direct, share * family.direct_error * of_lobe);
            // Of wide lobes few pairs meet many; of narrow ones the whole of the indirect part is in doubt.
            const double relief = std::max({1.0, 2 * s.slope, 0.45 / s.slope}),
                         spread = 0.0031 * std::pow(width / 0.3, -2.2) *
                                  std::pow(settings.directions / parts / 64, -0.95) * relief * s.few_facets();
            indirect =
                std::hypot(indirect, share * family.indirect_error * spread / (1 + spread / (0.5 * s.slope)));
        }
    }
    const Tile tile = run_tiles(scene, settings, 0, 0).front();
    const int sampled = s.indirect ? first_sampled_order(scene, tile, settings.directions) : 0;
    if (sampled == 2) rays = pairs = 0;
    RunForecast run;
    run.cpu_seconds =
        s.facets * s.sides() * (11.5e-9 + 5.7e-9 * s.sub_samples) +
        groups * values * per_value * (1 + 0.1 * s.sub_samples) + (s.indirect ? 23e-9 * rays : 0.0) +
        (sampled > 0 ? 600e-9 * s.facets / parts * s.lights * sampled_rays_per_facet(settings) : 0.0) +
        groups * pairs * (250e-9 + 9e-9 * s.lights + 2.8e-9 * s.views + per_row * (2 * s.lights + s.views));
    run.direct = std::hypot(direct, of_windows(s, settings));
    if (s.indirect) {
        run.indirect = indirect;
        run.lasting = 0.12 * indirect;  // directions that are used twice: graph_transport.cpp
        // What chains of lobes narrower than the directions are dense miss (graph_run.h): of order 3 and up
        // half from 30 times on, of order 2 from 1000 times on.
        const double lobe = lobe_share_of_pair(*scene.material, *scene.grid, tile, settings.directions),
                     order_2 = std::min(0.5, 0.1 * std::pow(s.slope / usual_slope, 1.5));
        if (lobe > most_honest_share)
            run.untold = order_2 * lobe / (lobe + 1000) +
                         (scene.plan->max_order == 2 ? 0.0 : order_2 * order_2 * lobe / (lobe + 30));
    }
    return run;
}

RunForecast forecast_forward(const MeasuredScene& scene, const RunSettings& settings) {
    const Scene s(scene, settings);
    const double rays_a_light = s.facets * settings.sub_samples / settings.block_step,
                 few = usual_facets / rays_a_light;
    const double total_share = reflected_share(*scene.material);
    double variance = 0, seconds = 0;
    for (const LobeShape& shape : lobe_shapes(*scene.material)) {
        const double share = shape.share / total_share;
        if (shape.width == 0) {
            // No dice: where rays go is as even as where they start.
            variance += std::pow(share * 0.0076 * std::pow(few, 0.65), 2);
            seconds += share * 320e-9;
            continue;
        }
        // Tails of narrow lobes: a single ray in a dark cell. The narrowest have hardly any.
        const double width = shape.width * std::pow(s.slope / usual_slope, 2.7),
                     tail = std::min({std::pow(0.1 / width, 3.5), 25.0, 25 * std::pow(width / 0.03, 0.7)});
        variance += std::pow(share * 0.066 * (std::sqrt(few) + tail * few), 2);
        seconds += share * (550e-9 + 300e-9 * s.slope);
    }
    RunForecast run;
    run.cpu_seconds = rays_a_light * s.lights * seconds;
    run.direct = std::sqrt(variance) * std::pow(s.cells / usual_cells, 0.6);
    return run;
}

}  // namespace gonio
