#include "measure/prediction.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "measure/planning.h"
#include "measure/windows.h"

namespace gonio {
namespace {

constexpr int typical_orders = 16;  // of a table with all orders separate

// Peak memory beside the runs, measured (README, cost against size): the program, then heights, search maxima
// and what reading needs.
constexpr double program_bytes = 60 << 20, bytes_per_point = 46;

struct Size {
    double rows, slices, channels;
    double table_bytes() const { return rows * slices * channels * 3 * sizeof(double); }
    // The values of several stages, their moments, the text of a table while it is written.
    double working_bytes() const { return 5 * table_bytes(); }
};

Size size_of(const Material& material, const BrdfPlan& plan) {
    const double rows = plan.pairs.empty() ? static_cast<double>(plan.incident.size() * plan.outgoing.size())
                                           : static_cast<double>(plan.pairs.size());
    const double orders = plan.separate_orders ? (plan.max_order > 0 ? plan.max_order : typical_orders) : 0;
    return {rows, 1 + orders, static_cast<double>(material.channels.size())};
}

double distinct_directions(const BrdfPlan& plan) {
    std::set<std::pair<double, double>> all;
    for (const auto* list : {&plan.incident, &plan.outgoing})
        for (const AnglesDeg& a : *list) all.insert({a.theta_deg, a.phi_deg});
    return static_cast<double>(all.size());
}

// One run, on one thread: what every facet costs, what each direction of the table and each shared direction
// of the operator adds. Fitted to runs of 12 jobs (N 64 to 1024, slopes 0.3 to 1.5, 16 to 290 directions).
double seconds_of_run(double unknowns, double directions, const RunSettings& settings) {
    constexpr double per_facet = 1.5e-6, per_direction = 25e-9, per_shared = 45e-9;
    return unknowns * settings.refinement * settings.refinement *
           (per_facet + per_direction * directions * settings.sub_samples +
            per_shared * settings.directions / (settings.refinement * settings.refinement));
}

double mean_albedo(const Material& material) {
    const Lambertian* lambertian = pure_lambertian(material);
    if (!lambertian || lambertian->albedo.is_map() || lambertian->albedo.empty()) return 0.5;
    const std::vector<double>& values = lambertian->albedo.constant;
    double sum = 0;
    for (const double albedo : values) sum += albedo;
    return sum / static_cast<double>(values.size());
}

}  // namespace

Prediction predict_brdf(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                        long long max_bytes) {
    RunContext context;
    context.surface = &surface;
    context.material = &material;
    context.plan = &plan;
    const Lambertian gray{Parameter(0.5).for_channels(material.channels.size())},
        *lambertian = pure_lambertian(material);
    context.lambertian = lambertian ? lambertian : &gray;
    const double cells = static_cast<double>(surface.nx) * surface.ny,
                 window_cells = std::pow(tile_core + 2.0 * tile_halo, 2),
                 directions = distinct_directions(plan), target = plan.accuracy.target();
    RunSettings settings = first_settings(context, target > 0 ? target : Accuracy::default_target);
    double runs = runs_at_first;
    if (plan.accuracy.samples) {
        settings = {plan.accuracy.samples->sub_samples, plan.accuracy.samples->directions,
                    plan.accuracy.samples->refinement};
        runs = plan.accuracy.samples->replicates;
    }
    double worked = cells;
    if (settings.tiles_x > 0) {
        // Six windows of a Gaussian field of slope 0.7 leave 0.75 %; more windows until that is the target,
        // or the whole.
        worked = window_cells;
        const double needed = runs * std::max(1.0, std::pow(0.0075 / std::max(target, 1e-5), 2));
        if (needed > most_window_runs)  // then every run has more windows, as planning.cpp does it
            worked = std::min(cells, window_cells * std::pow(std::ceil(std::sqrt(needed / runs)), 2));
        else
            runs = needed;
    }
    const MeshBias mesh = predict_mesh_bias(surface);
    const bool two_grids = target > 0 && mesh.guess * mesh.guess_caution * mean_albedo(material) > target;
    const Size size = size_of(material, plan);
    Prediction prediction;
    prediction.cpu_seconds = 0.05 + runs * seconds_of_run(2 * worked, directions, settings);
    if (two_grids) prediction.cpu_seconds *= 2.5;
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = target > 0 ? std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds)
                                            : *plan.accuracy.max_seconds;
    RunSettings largest = settings;
    if (worked == cells) largest.tiles_x = largest.tiles_y = 0;
    // A run is cut to its share; what the whole period's runs keep for the noise bias comes on top
    // (brdf.cpp).
    const double one_run = std::min(run_bytes(context, largest, static_cast<int>(directions), 0),
                                    0.4 * static_cast<double>(max_bytes)),
                 kept = largest.tiles_x > 0 ? 0 : 8 * runs * directions * cells;
    prediction.table_bytes = size.table_bytes();
    prediction.memory_bytes = program_bytes + bytes_per_point * cells + size.working_bytes() + one_run +
                              (kept < 0.1 * static_cast<double>(max_bytes) ? kept : 0);
    return prediction;
}

Prediction predict_reference(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                             const ReferenceOptions& reference) {
    constexpr double rays_per_second = 4e6;
    const Size size = size_of(material, plan);
    const double bounces = plan.max_order > 0 ? plan.max_order : 1 + mean_albedo(material),
                 rays = static_cast<double>(reference.paths) * static_cast<double>(plan.outgoing.size()) *
                        bounces * (1.0 + static_cast<double>(plan.incident.size()));
    return {0.05 + rays / rays_per_second,
            program_bytes + 250.0 * surface.nx * surface.ny + size.working_bytes(), size.table_bytes()};
}

}  // namespace gonio
