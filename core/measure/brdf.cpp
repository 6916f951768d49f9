#include "measure/brdf.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>

#include "base/parallel.h"
#include "measure/describe.h"
#include "measure/estimate.h"
#include "measure/planning.h"
#include "measure/shard_bytes.h"
#include "measure/simplify.h"
#include "measure/windows.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr int most_stages = 12;

// At most 5 % of the target, in steps: jobs whose targets lie between two of them can have runs in common.
double series_tolerance(double target) {
    for (const double tolerance : {5e-5, 1e-5})
        if (tolerance <= 0.05 * target) return tolerance;
    return 1e-6;
}

// Everything that one measurement carries from stage to stage.
class Measurement {
  public:
    Measurement(const HeightField& surface, const Lambertian& material, const Material& named,
                const BrdfPlan& plan, const RunOptions& options, const Monitor& monitor)
        : plan_(plan),
          options_(options),
          shards_(options.checkpoints, options.shard_task),
          monitor_(monitor),
          scene_(simplify_scene(surface, material, options.allow_skips)),
          started_(std::chrono::steady_clock::now()) {
        Table& table = result_.table;
        table.incident = plan.incident;
        table.outgoing = plan.outgoing;
        table.pairs = plan.pairs;
        table.channels = named.channels;
        result_.report.skipped = scene_.skipped;
        for (size_t r = 0; r < table.rows(); ++r) {
            groups_.light.push_back(table.pair(r).first);
            groups_.view.push_back(table.pair(r).second);
        }
        groups_.n_lights = static_cast<int>(plan.incident.size());
        groups_.n_views = static_cast<int>(plan.outgoing.size());
    }

    BrdfResult run() {
        Report& report = result_.report;
        const double most = albedo_range().second;
        if (options_.allow_skips && is_plane(scene_.surface) && !scene_.material.albedo.is_map()) {
            report.skipped.push_back({"all tracing", "the surface is a plane: f = albedo / pi exactly"});
            fill_exact([&](size_t c) { return scene_.material.albedo.constant[c] / pi; });
        } else if (options_.allow_skips && most == 0) {
            report.skipped.push_back({"all tracing", "the surface is black"});
            fill_exact([](size_t) { return 0.0; });
        } else {
            prepare(most);
            measure();
        }
        for (const auto& [key, value] : report.settings) result_.table.provenance.push_back({key, value});
        return std::move(result_);
    }

  private:
    std::pair<double, double> albedo_range() const { return scene_.material.albedo.range(); }

    template <class Value>
    void fill_exact(Value&& value) {
        Table& table = result_.table;
        table.orders = plan_.separate_orders ? std::max(1, plan_.max_order) : 0;
        const size_t n = table.channels.size() * table.slices() * table.rows();
        table.f.assign(n, 0.0f);
        table.se.assign(n, 0.0f);
        table.bias.assign(n, 0.0f);
        for (size_t c = 0; c < table.channels.size(); ++c)
            for (size_t slice = 0; slice < std::min<size_t>(2, table.slices());
                 ++slice)  // what there is, is first order
                std::fill_n(table.f.begin() + static_cast<long>(table.index(c, slice, 0)), table.rows(),
                            static_cast<float>(value(c)));
        result_.report.settings.push_back({"transport", "closed form"});
    }

    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
    }
    double target() const { return plan_.accuracy.target(); }

    void prepare(double largest_albedo) {
        const HeightField& s = scene_.surface;
        const double grid_bytes = static_cast<double>(s.nx) * s.ny * 4 * 8;
        if (grid_bytes > 0.8 * static_cast<double>(options_.max_bytes))
            throw Error(ErrorCode::limit, "/surface", std::to_string(s.nx) + " x " + std::to_string(s.ny),
                        "needs " + number(grid_bytes / 1e9) + " GB of " +
                            number(static_cast<double>(options_.max_bytes) / 1e9) +
                            " GB; crop or resample it");
        grid_ = make_march_grid(s);
        context_.surface = &scene_.surface;
        context_.grid = &grid_;
        context_.material = &scene_.material;
        context_.plan = &plan_;
        auto vectors = [&](const std::vector<AnglesDeg>& angles) {
            std::vector<Vec3> list;
            for (const AnglesDeg& a : angles) {
                Vec3 d = to_vector(a);
                if (scene_.axes_swapped) std::swap(d.x, d.y);
                list.push_back(d);
            }
            return list;
        };
        context_.lights = vectors(plan_.incident);
        context_.views = vectors(plan_.outgoing);
        Report& report = result_.report;
        if (options_.allow_skips) match_views();
        if (!context_.view_to_light.empty())
            report.skipped.push_back({"half of the directions", "lights and views are the same set"});
        context_.skip_steep = options_.allow_skips;
        context_.keep_orders = plan_.separate_orders || !options_.allow_skips;
        context_.max_order = plan_.max_order;
        if (result_.table.channels.size() > 1 && !scene_.material.albedo.is_map())
            report.skipped.push_back(
                {"all channels but one", "constant albedo: orders are kept apart and serve every channel"});
        if (!context_.keep_orders && (result_.table.channels.size() == 1 || scene_.material.albedo.is_map()))
            report.skipped.push_back(
                {"a product per order", "one channel, orders not asked for: they are summed first"});

        // Of the light of a facet, at most this share comes from other facets: they stand within the slab |z|
        // <= L / sqrt(1 + L^2).
        const double z_max = grid_.max_slope / std::sqrt(1 + grid_.max_slope * grid_.max_slope);
        skipped_bound_ = std::min(1.0, 4 * z_max * z_max) * largest_albedo;
        if (options_.allow_skips && skipped_bound_ < 0.1 * std::max(target(), 1e-6) && plan_.max_order != 1) {
            context_.indirect = false;
            report.skipped.push_back(
                {"indirect light", "slopes up to " + number(grid_.max_slope) + " send facets less than " +
                                       number(skipped_bound_) + " of their light from others"});
        } else {
            skipped_bound_ = 0;
        }
        context_.series_tolerance = series_tolerance(target());
        if (context_.max_order == 1) report.skipped.push_back({"indirect light", "max_order is 1"});
    }

    // views[v] == lights[view_to_light[v]], if the two sets are equal.
    void match_views() {
        if (plan_.incident.size() != plan_.outgoing.size()) return;
        std::map<std::pair<double, double>, int> light_of;
        for (size_t l = 0; l < plan_.incident.size(); ++l)
            light_of[{plan_.incident[l].theta_deg, plan_.incident[l].phi_deg}] = static_cast<int>(l);
        std::vector<int> found;
        for (const AnglesDeg& v : plan_.outgoing) {
            const auto at = light_of.find({v.theta_deg, v.phi_deg});
            if (at == light_of.end()) return;
            found.push_back(at->second);
        }
        if (light_of.size() == found.size()) context_.view_to_light = std::move(found);
    }

    void measure();
    // Of a part of the stage, for every job that comes to the same stage by the same settings.
    std::string part_key(const Stage& stage, const std::string& part) const {
        return "stage" + std::to_string(stage.number) + "-" + part + "-" +
               settings_key(context_, stage.settings);
    }
    void run_stage(Stage& stage, int n_runs);
    void find_mesh_bias(const std::vector<Stage>& stages);
    bool ends_in_time(const Stage& stage, NextStep& step) const;

    const BrdfPlan& plan_;
    RunOptions options_;
    Shards shards_;
    const Monitor& monitor_;
    SimplifiedScene scene_;
    std::chrono::steady_clock::time_point started_;
    BrdfResult result_;
    RowGroups groups_;
    MarchGrid grid_;
    RunContext context_;
    double skipped_bound_ = 0;
    MeshBias mesh_bias_;
    double seconds_per_run_ = 0;
    RunValues totals_;  // counters of all runs
    int runs_found_ = 0;
    std::mutex mutex_;
};

void Measurement::run_stage(Stage& stage, int n_runs) {
    // What is decided from memory must not depend on the number of threads: a run gets the same share on any
    // machine, and memory limits how many go side by side.
    const int n_views = context_.view_to_light.empty() ? static_cast<int>(context_.views.size()) : 0,
              n_lights = static_cast<int>(context_.lights.size());
    const double bytes = std::min(run_bytes(context_, stage.settings, n_lights, n_views),
                                  static_cast<double>(context_.max_bytes));
    const int room = std::max(1, static_cast<int>(0.8 * static_cast<double>(options_.max_bytes) / bytes));
    const int outer = std::min({options_.n_threads, n_runs, room});
    const int first = stage.f.count();
    const bool transport = context_.indirect && context_.max_order != 1;
    // K g of all runs is kept where memory allows: else a side measurement tells the noise bias.
    const int kept_columns = context_.view_to_light.empty() ? std::min(n_lights, n_views) : n_lights;
    const double kept_bytes = 4.0 * 2 * n_runs * kept_columns * scene_.surface.nx * scene_.surface.ny *
                              std::pow(stage.settings.refinement, 2);
    context_.keep_first = transport && first == 0 && stage.settings.tiles_x == 0 &&
                          kept_bytes < 0.1 * static_cast<double>(options_.max_bytes);
    std::vector<RunValues> runs(n_runs);
    int done = 0;
    const double began = seconds();
    auto run = [&](const Shards::Batch& batch, int offset, int position, int n_threads) {
        RunValues& values = runs[offset + position];
        values =
            run_once(context_, stage.settings, stage.number, first + offset + position, n_threads, monitor_);
        if (shards_.are_kept()) shards_.save(batch, position, to_bytes(values));
        const std::lock_guard lock(mutex_);
        ++done;
        monitor_.report({static_cast<double>(done) / n_runs,
                         "runs of stage " + std::to_string(stage.number + 1), result_.report.relative_error});
    };
    auto run_batch = [&](int offset, int n) {
        std::vector<std::string> keys;
        for (int k = 0; k < n; ++k)
            keys.push_back(part_key(stage, "run" + std::to_string(first + offset + k)));
        const Shards::Batch batch = shards_.take(std::move(keys));
        for (int k = 0; k < n; ++k)
            if (batch.saved[k]) runs[offset + k] = run_values_from(*batch.saved[k]);
        const int n_new = static_cast<int>(batch.to_compute.size()), side_by_side = std::min(outer, n_new);
        done += n - n_new;
        runs_found_ += n - n_new;
        parallel_for(n_new, outer, [&](int k) {
            run(batch, offset, batch.to_compute[k], std::max(1, options_.n_threads / side_by_side));
        });
        shards_.finish(batch);
    };
    int alone = 0;
    if (plan_.separate_orders &&
        context_.single_orders == 0) {  // the first run tells how many orders all of them keep
        run_batch(alone++, 1);
        context_.fixed_applications = runs[0].applications;
        context_.single_orders = runs[0].higher_orders + 1;
    }
    run_batch(alone, n_runs - alone);
    seconds_per_run_ = (seconds() - began) / n_runs * outer;
    if (transport && !stage.noise && !context_.keep_first)
        stage.noise = noise_bias_from(shards_.part(part_key(stage, "noise"), [&] {
            return to_bytes(measure_noise_bias(context_, stage.settings, options_.n_threads, monitor_));
        }));
    if (context_.keep_first) {
        std::vector<const Fields*> first_orders;
        for (const RunValues& r : runs) first_orders.push_back(&r.first);
        stage.noise = noise_bias(whole_tile(context_, stage.settings), first_orders, runs[0].first_irradiance,
                                 !context_.view_to_light.empty(), options_.n_threads);
    }
    for (const RunValues& r : runs) {
        stage.f.add(r.f);
        stage.direct.add(r.direct);
        stage.projected_lights.add(r.projected_lights);
        stage.projected_views.add(r.projected_views);
        stage.remainder = std::max(stage.remainder, r.remainder);
        stage.ratio = std::max(stage.ratio, r.ratio);
        totals_.rays += r.rays;
        totals_.rays_skipped += r.rays_skipped;
        totals_.links += r.links;
        totals_.substituted += r.substituted;
        totals_.dropped += r.dropped;
        totals_.truncated_bundles += r.truncated_bundles;
        totals_.seconds_direct += r.seconds_direct;
        totals_.seconds_links += r.seconds_links;
        totals_.seconds_series += r.seconds_series;
        totals_.applications = std::max(totals_.applications, r.applications);
    }
}

// The two-grid run is skipped where a guess from the relief is far below what was asked for.
void Measurement::find_mesh_bias(const std::vector<Stage>& stages) {
    if (!context_.indirect || context_.max_order == 1) return;
    const bool explicit_samples = plan_.accuracy.samples.has_value();
    mesh_bias_ = predict_mesh_bias(scene_.surface);
    const Estimate with = make_estimate(context_, groups_, stages, mesh_bias_, skipped_bound_);
    const Estimate without = make_estimate(context_, groups_, stages, {}, skipped_bound_);
    const double guess =
        safe_sqrt(with.systematic * with.systematic - without.systematic * without.systematic);
    if (options_.allow_skips && mesh_bias_is_predictable(context_) &&
        mesh_bias_.guess_caution * guess < std::max(target(), explicit_samples ? with.random : 0.0)) {
        if (stages.size() == 1)
            result_.report.skipped.push_back(
                {"two-grid run", "facets resolve the relief: mesh bias guessed at " + number(guess)});
        return;
    }
    const double albedo = scene_.material.albedo.is_map() ? 1.0 : albedo_range().second;
    mesh_bias_ = mesh_bias_from(shards_.part(part_key(stages.back(), "mesh"), [&] {
        return to_bytes(measure_mesh_bias(context_, stages.back().settings, albedo * stages.back().ratio,
                                          options_.n_threads, monitor_));
    }));
}

// Whether the step ends before max_seconds; a step that would not is made smaller if that helps.
bool Measurement::ends_in_time(const Stage& stage, NextStep& step) const {
    if (!plan_.accuracy.max_seconds) return true;
    const double left = *plan_.accuracy.max_seconds - seconds();
    auto wall = [&](int runs, double cost) {
        return cost * seconds_per_run_ * std::ceil(static_cast<double>(runs) / options_.n_threads);
    };
    if (step.more_runs > 0) {
        if (wall(step.more_runs, 1) <= left) return true;
    } else if (wall(runs_at_first, relative_cost(context_, step.settings, stage.settings)) <= left) {
        return true;
    }
    step.more_runs = 2;
    return stage.f.count() < most_window_runs && wall(2, 1) <= left;
}

void Measurement::measure() {
    const std::optional<Accuracy::Samples>& samples = plan_.accuracy.samples;
    const double wanted = target();
    // Of one run: two fit side by side. A share by threads would cut a job differently on other machines.
    context_.max_bytes = static_cast<long long>(0.4 * static_cast<double>(options_.max_bytes));
    std::vector<Stage> stages(1);
    if (samples) {
        stages[0].settings = {samples->sub_samples, samples->directions, samples->refinement, 0, 0};
        if (!run_fits(context_, stages[0].settings))
            std::tie(stages[0].settings.tiles_x, stages[0].settings.tiles_y) = covering_windows(context_);
        // Fewer would let single rays carry more light than there is.
        const int least = 16 * samples->refinement * samples->refinement;
        if (samples->directions < least && context_.indirect)
            throw Error(ErrorCode::invalid_input, "/accuracy/samples/directions",
                        std::to_string(samples->directions),
                        "needs at least 16 refinement^2 = " + std::to_string(least));
    } else {
        stages[0].settings = first_settings(context_, wanted > 0 ? wanted : Accuracy::default_target);
    }
    if (const double least = run_bytes(context_, stages[0].settings, column_block, column_block);
        least > static_cast<double>(options_.max_bytes))
        throw Error(ErrorCode::limit, "/surface",
                    std::to_string(scene_.surface.nx) + " x " + std::to_string(scene_.surface.ny),
                    "needs " + number(least / 1e6) + " MB of the " +
                        number(static_cast<double>(options_.max_bytes) / 1e6) + " MB allowed");
    context_.single_orders = plan_.separate_orders ? plan_.max_order : 0;
    run_stage(stages[0], samples ? std::max(2, samples->replicates) : runs_at_first);
    find_mesh_bias(stages);

    Estimate e = make_estimate(context_, groups_, stages, mesh_bias_, skipped_bound_);
    while (!samples && (wanted == 0 || e.total > wanted) && static_cast<int>(stages.size()) < most_stages) {
        result_.report.relative_error = e.total;
        NextStep step = next_step(context_, stages.back(), e, wanted > 0 ? wanted : 0.5 * e.total);
        if (!step.possible || !ends_in_time(stages.back(), step)) break;
        if (step.more_runs > 0) {
            run_stage(stages.back(), step.more_runs);
        } else {
            const bool finer = step.settings.refinement != stages.back().settings.refinement;
            Stage next;
            next.settings = step.settings;
            next.number = static_cast<int>(stages.size());
            const RunSettings& now = stages.back().settings;
            if (next.settings.tiles_x > 0 && next.settings.directions == now.directions && !finer)
                next.noise = stages.back().noise;
            stages.push_back(std::move(next));
            run_stage(stages.back(), runs_at_first);
            if (finer) find_mesh_bias(stages);
        }
        e = make_estimate(context_, groups_, stages, mesh_bias_, skipped_bound_);
    }

    Report& report = result_.report;
    Table& table = result_.table;
    const size_t n = e.f.size();
    table.orders = static_cast<int>(n / (table.channels.size() * table.rows())) - 1;
    table.f.resize(n);
    table.se.resize(n);
    table.bias.resize(n);
    for (size_t i = 0; i < n; ++i) {
        if (!std::isfinite(e.f[i]) || !std::isfinite(e.se[i]) || !std::isfinite(e.bias[i]))
            throw Error(
                ErrorCode::internal, "/measure", "",
                "value " + std::to_string(i) + " is not finite: a defect of gonio, please report the job");
        table.f[i] = static_cast<float>(std::max(0.0, e.f[i]));
        table.se[i] = static_cast<float>(e.se[i]);
        table.bias[i] = static_cast<float>(e.bias[i]);
    }
    report.relative_error = e.total;
    report.target_met = wanted == 0 || e.total <= wanted;
    describe_runs(context_, stages, mesh_bias_, totals_, report);
    if (runs_found_ > 0)
        report.skipped.push_back({std::to_string(runs_found_) + " runs",
                                  "a checkpoint had them, of this job or of one with another target"});
    report.seconds.emplace_back("wall", seconds());
    if (!report.target_met)
        report.warnings.push_back("target_relative_error " + number(wanted) +
                                  " was not reached: " + number(e.total));
}

}  // namespace

BrdfResult measure_brdf(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                        const RunOptions& options, const Monitor& monitor) {
    validate(material, surface.nx, surface.ny);
    if (plan.incident.empty() || plan.outgoing.empty())
        throw Error(ErrorCode::invalid_input, "/measure", "",
                    "needs at least one incident and one outgoing direction");
    const Lambertian* lambertian = pure_lambertian(material);
    if (!lambertian)
        throw Error(ErrorCode::invalid_input, "/material", "", "only Lambertian facets are measured so far");
    return Measurement(surface, {lambertian->albedo.for_channels(material.channels.size())}, material, plan,
                       options, monitor)
        .run();
}

}  // namespace gonio
