#include "measure/diffuse_transport.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "measure/cell_views.h"
#include "measure/describe.h"
#include "measure/shard_bytes.h"
#include "measure/windows.h"

namespace gonio {
namespace {

// At most 5 % of the target, in steps: jobs whose targets lie between two of them can have runs in common.
double series_tolerance(double target) {
    for (const double tolerance : {5e-5, 1e-5})
        if (tolerance <= 0.05 * target) return tolerance;
    return 1e-6;
}

}  // namespace

DiffuseTransport::DiffuseTransport(const MeasuredScene& scene, const Lambertian& material, Report& report) {
    static_cast<MeasuredScene&>(context_) = scene;
    context_.lambertian = &material;
    const BrdfPlan& plan = *scene.plan;
    const double target = plan.accuracy.target();
    context_.keep_orders = plan.separate_orders || !scene.allow_skips;
    context_.max_order = plan.max_order;
    if (scene.n_channels() > 1 && !material.albedo.is_map())
        report.skipped.push_back(
            {"all channels but one", "constant albedo: orders are kept apart and serve every channel"});
    if (!context_.keep_orders && (scene.n_channels() == 1 || material.albedo.is_map()))
        report.skipped.push_back(
            {"a product per order", "one channel, orders not asked for: they are summed first"});

    // Of the light of a facet, at most this share comes from other facets: they stand within the slab |z|
    // <= L / sqrt(1 + L^2).
    const double slope = scene.grid->max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    skipped_bound_ = std::min(1.0, 4 * z_max * z_max) * context_.lambertian->albedo.range().second;
    if (scene.allow_skips && skipped_bound_ < 0.1 * std::max(target, 1e-6) && plan.max_order != 1) {
        context_.indirect = false;
        report.skipped.push_back({"indirect light", "slopes up to " + number(slope) +
                                                        " send facets less than " + number(skipped_bound_) +
                                                        " of their light from others"});
    } else {
        skipped_bound_ = 0;
    }
    context_.series_tolerance = series_tolerance(target);
    if (context_.max_order == 1) report.skipped.push_back({"indirect light", "max_order is 1"});
    context_.single_orders = plan.separate_orders ? plan.max_order : 0;
}

RunSettings DiffuseTransport::first_settings(double target) const {
    return gonio::first_settings(context_, target);
}

RunSettings DiffuseTransport::settings_of(const Accuracy::Samples& samples) const {
    RunSettings settings{samples.sub_samples, samples.directions, samples.refinement, 0, 0};
    if (!run_fits(context_, settings))
        std::tie(settings.tiles_x, settings.tiles_y) = covering_windows(context_);
    // Fewer would let single rays carry more light than there is.
    const int least = 16 * samples.refinement * samples.refinement;
    if (samples.directions < least && context_.indirect)
        throw Error(ErrorCode::invalid_input, "/accuracy/samples/directions",
                    std::to_string(samples.directions),
                    "needs at least 16 refinement^2 = " + std::to_string(least));
    return settings;
}

double DiffuseTransport::least_bytes(const RunSettings& settings) const {
    return run_bytes(context_, settings, column_block, column_block);
}

double DiffuseTransport::wanted_bytes(const RunSettings& settings) const {
    const int n_views = context_.view_to_light.empty() ? views_of_run(context_, settings) : 0;
    return run_bytes(context_, settings, static_cast<int>(context_.lights.size()), n_views);
}

RunValues DiffuseTransport::run(const RunSettings& settings, int stage, int run, int n_threads,
                                const Monitor& monitor) const {
    return run_with_cells(context_, settings, stage, run,
                          [&](const RunContext& context, const RunSettings& at_place) {
                              return run_once(context, at_place, stage, run, n_threads, monitor);
                          });
}

std::string DiffuseTransport::settings_key(const RunSettings& settings) const {
    return gonio::settings_key(
        TransportKind::diffuse, settings,
        {static_cast<double>(context_.indirect), static_cast<double>(context_.allow_skips),
         static_cast<double>(context_.keep_orders), static_cast<double>(!context_.view_to_light.empty()),
         static_cast<double>(context_.fixed_applications), static_cast<double>(context_.single_orders),
         static_cast<double>(context_.keep_first), static_cast<double>(context_.max_bytes),
         context_.series_tolerance});
}

void DiffuseTransport::fix_orders(const RunValues& first) {
    if (context_.single_orders > 0) return;
    context_.fixed_applications = first.applications;
    context_.single_orders = first.higher_orders + 1;
}

void DiffuseTransport::begin_stage(const Stage& stage, int n_runs) {
    // K g of all runs is kept where memory allows: else a side measurement tells the noise bias. max_bytes is
    // 0.4 of what all runs may use.
    const int n_lights = static_cast<int>(context_.lights.size()),
              n_views = static_cast<int>(context_.views.size());
    const int kept_columns = context_.view_to_light.empty() ? std::min(n_lights, n_views) : n_lights;
    const double kept_bytes = 4.0 * 2 * n_runs * kept_columns * context_.surface->nx * context_.surface->ny *
                              std::pow(stage.settings.refinement, 2);
    // Not of cells, whose directions are others in every run.
    context_.keep_first = context_.plan->outgoing_cells.empty() && context_.transports() &&
                          stage.f.count() == 0 && stage.settings.tiles_x == 0 &&
                          kept_bytes < 0.25 * static_cast<double>(context_.max_bytes);
}

void DiffuseTransport::end_stage(Stage& stage, const std::vector<RunValues>& runs, const SideWork& side) {
    if (context_.keep_first) {
        std::vector<const Fields*> first_orders;
        for (const RunValues& r : runs) first_orders.push_back(&r.first);
        stage.noise = noise_bias(whole_tile(context_, stage.settings), first_orders, runs[0].first_irradiance,
                                 !context_.view_to_light.empty(), side.n_threads);
    } else if (context_.transports() && !stage.noise) {
        stage.noise = noise_bias_from(side.kept(stage, "noise", [&] {
            return to_bytes(measure_noise_bias(context_, stage.settings, side.n_threads, side.monitor));
        }));
    }
}

// The two-grid run is skipped where a guess from the relief is far below what was asked for.
void DiffuseTransport::find_bias(const std::vector<Stage>& stages, const SideWork& side, Report& report) {
    if (!context_.transports()) return;
    mesh_bias_ = predict_mesh_bias(*context_.surface);
    const Estimate with = estimate(stages),
                   without = make_estimate(context_, context_.groups, stages, {}, skipped_bound_);
    const double guess =
        safe_sqrt(with.systematic * with.systematic - without.systematic * without.systematic);
    const Accuracy& accuracy = context_.plan->accuracy;
    if (context_.allow_skips && mesh_bias_is_predictable(context_) &&
        mesh_bias_.guess_caution * guess <
            std::max(accuracy.target(), accuracy.samples ? with.random : 0.0)) {
        if (stages.size() == 1)
            report.skipped.push_back(
                {"two-grid run", "facets resolve the relief: mesh bias guessed at " + number(guess)});
        return;
    }
    const double albedo =
        context_.lambertian->albedo.is_map() ? 1.0 : context_.lambertian->albedo.range().second;
    mesh_bias_ = mesh_bias_from(side.kept(stages.back(), "mesh", [&] {
        return to_bytes(measure_mesh_bias(context_, stages.back().settings, albedo * stages.back().ratio,
                                          side.n_threads, side.monitor));
    }));
}

Estimate DiffuseTransport::estimate(const std::vector<Stage>& stages) const {
    return make_estimate(context_, context_.groups, stages, mesh_bias_, skipped_bound_);
}

NextStep DiffuseTransport::next_step(const Stage& stage, const Estimate& estimate, double target) const {
    return gonio::next_step(context_, stage, estimate, target);
}

RunForecast DiffuseTransport::forecast(const RunSettings& settings) const {
    return forecast_diffuse(context_, settings);
}

double DiffuseTransport::relative_cost(const RunSettings& settings, const RunSettings& reference) const {
    return gonio::relative_cost(context_, settings, reference);
}

void DiffuseTransport::describe(const std::vector<Stage>& stages, const RunValues& totals,
                                Report& report) const {
    describe_runs(context_, stages, mesh_bias_, totals, report);
}

}  // namespace gonio
