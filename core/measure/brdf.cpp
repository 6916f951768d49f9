#include "measure/brdf.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>

#include "base/parallel.h"
#include "measure/accuracy.h"
#include "measure/mesh_bias.h"
#include "measure/run.h"
#include "measure/simplify.h"
#include "surface/facet_mesh.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr int runs_at_first = 4, most_runs = 16, most_stages = 12;
constexpr double default_target = 0.01;

std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", x);
    return text;
}

// Everything that one measurement carries from stage to stage.
class Measurement {
  public:
    Measurement(const HeightField& surface, const Lambertian& material, const Material& named,
                const BrdfPlan& plan, const RunOptions& options, const Monitor& monitor)
        : plan_(plan),
          options_(options),
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
        const auto [least, most] = albedo_range();
        if (options_.allow_skips && is_plane(scene_.surface) && !scene_.material.is_map()) {
            report.skipped.push_back({"all tracing", "the surface is a plane: f = albedo / pi exactly"});
            fill_exact([&](size_t c) { return scene_.material.albedo[c] / pi; });
        } else if (options_.allow_skips && most == 0) {
            report.skipped.push_back({"all tracing", "the surface is black"});
            fill_exact([](size_t) { return 0.0; });
        } else {
            prepare(most);
            measure();
        }
        (void)least;
        for (const auto& [key, value] : report.settings) result_.table.provenance.push_back({key, value});
        return std::move(result_);
    }

  private:
    std::pair<double, double> albedo_range() const {
        const Lambertian& m = scene_.material;
        if (m.is_map()) {
            const auto [low, high] = std::minmax_element(m.map.begin(), m.map.end());
            return {*low, *high};
        }
        const auto [low, high] = std::minmax_element(m.albedo.begin(), m.albedo.end());
        return {*low, *high};
    }

    template <class Value>
    void fill_exact(Value&& value) {
        Table& table = result_.table;
        table.orders = plan_.separate_orders ? 1 : 0;
        const size_t n = table.channels.size() * table.slices() * table.rows();
        table.f.resize(n);
        table.se.assign(n, 0.0f);
        table.bias.assign(n, 0.0f);
        for (size_t c = 0; c < table.channels.size(); ++c)
            for (size_t k = 0; k < table.slices() * table.rows(); ++k)
                table.f[c * table.slices() * table.rows() + k] = static_cast<float>(value(c));
        result_.report.settings.push_back({"transport", "closed form"});
    }

    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
    }
    double target() const {
        if (plan_.accuracy.target_relative_error) return *plan_.accuracy.target_relative_error;
        return plan_.accuracy.max_seconds || plan_.accuracy.samples ? 0.0 : default_target;
    }

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
        context_.combine_orders = options_.allow_skips && plan_.max_order == 0 && !plan_.separate_orders &&
                                  result_.table.channels.size() == 1 && !scene_.material.is_map();
        if (scene_.material.is_map() && !plan_.separate_orders && plan_.max_order == 0 &&
            options_.allow_skips)
            context_.combine_orders = true;
        context_.max_order = plan_.max_order;
        if (result_.table.channels.size() > 1 && !scene_.material.is_map())
            report.skipped.push_back(
                {"all channels but one", "constant albedo: orders are kept apart and serve every channel"});
        if (context_.combine_orders)
            report.skipped.push_back(
                {"a product per order", "one channel, orders not asked for: they are summed first"});

        // Of the light of a facet, at most this share comes from other facets: they stand within the slab |z|
        // <= L / sqrt(1 + L^2).
        const double z_max = grid_.max_slope / std::sqrt(1 + grid_.max_slope * grid_.max_slope);
        gentle_bound_ = std::min(1.0, 4 * z_max * z_max) * largest_albedo;
        if (options_.allow_skips && gentle_bound_ < 0.1 * std::max(target(), 1e-6) && plan_.max_order != 1) {
            context_.indirect = false;
            report.skipped.push_back(
                {"indirect light", "slopes up to " + number(grid_.max_slope) + " send facets less than " +
                                       number(gentle_bound_) + " of their light from others"});
        } else {
            gentle_bound_ = 0;
        }
        context_.series_tolerance = std::clamp(0.05 * target(), 1e-6, 1e-3);
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

    double rms_slope() const {
        const HeightField& s = scene_.surface;
        const int step = std::max(1, s.ny / 128);
        double sum = 0;
        long long n = 0;
        for (int j = 0; j < s.ny; j += step)
            for (int i = 0; i < s.nx; ++i, ++n) {
                const Gradient g = facet_gradient(s, 0, i, j);
                sum += g.x * g.x + g.y * g.y;
            }
        return std::sqrt(sum / static_cast<double>(n));
    }

    // Cells that one window costs, and windows that cover the surface once.
    static double window_cells() { return std::pow(tile_core + 2.0 * tile_halo, 2); }
    std::pair<int, int> covering_windows() const {
        const HeightField& s = scene_.surface;
        auto count = [](int n) { return std::max(1, (n + tile_core - 1) / tile_core); };
        return {count(s.nx - 2 * s.border_x), count(s.ny - 2 * s.border_y)};
    }
    bool whole_fits(int refinement, const RunSettings& settings) const {
        RunSettings whole = settings;
        whole.tiles_x = whole.tiles_y = 0;
        whole.refinement = refinement;
        const bool same = !context_.view_to_light.empty();
        return run_bytes(context_, whole, static_cast<int>(context_.lights.size()),
                         same ? 0 : static_cast<int>(context_.views.size())) <
               static_cast<double>(context_.max_bytes);
    }

    // A first guess from the measurements of shared/performance E (slope 0.7, 32768 facets): direct error
    // 0.11 % with one sub-sample, indirect error 0.75 % with 16 directions, falling as n^-1.7. What it gets
    // wrong, the stages mend.
    RunSettings first_settings() const {
        RunSettings settings;
        const HeightField& s = scene_.surface;
        const double slope = std::clamp(rms_slope(), 0.05, 3.0),
                     wanted = std::max(target() > 0 ? target() : default_target, 1e-5);
        double cells = static_cast<double>(s.nx) * s.ny;
        if (cells > 1.5 * window_cells()) {
            settings.tiles_x = settings.tiles_y = 1;
            cells = tile_core * tile_core;
        }
        const double share = 0.6 * wanted * std::sqrt(static_cast<double>(runs_at_first)) /
                             student_one_sigma(runs_at_first + 4);
        const double direct = 0.0011 * (slope / 0.7) * std::sqrt(16384 / cells),
                     indirect = 0.0075 * std::pow(slope / 0.7, 1.5);
        settings.sub_samples = std::clamp(static_cast<int>(std::ceil(std::pow(direct / share, 1.25))), 1, 64);
        settings.directions =
            std::clamp(static_cast<int>(16 * std::ceil(std::pow(indirect / share, 1 / 1.7))), 16, 1024);
        return settings;
    }

    void measure();
    struct Stage {
        RunSettings settings;
        int number = 0;
        Moments f, direct;
        double remainder = 0;
    };
    struct Estimate {
        std::vector<double> f, se, bias;  // of every slice and channel
        double total = 0, random = 0, direct = 0,
               systematic = 0;  // relative, rms over the rows of all channels
    };
    void run_stage(Stage& stage, int n_runs);
    Estimate estimate(const std::vector<Stage>& stages) const;
    bool next_settings(const Stage& stage, const Estimate& e, double target, RunSettings& next,
                       int& more_runs) const;

    const BrdfPlan& plan_;
    RunOptions options_;
    const Monitor& monitor_;
    SimplifiedScene scene_;
    std::chrono::steady_clock::time_point started_;
    BrdfResult result_;
    RowGroups groups_;
    MarchGrid grid_;
    RunContext context_;
    double gentle_bound_ = 0;
    MeshBias mesh_bias_;
    double seconds_per_run_ = 0;
    RunValues totals_;  // counters of all runs
    std::mutex mutex_;
};

void Measurement::run_stage(Stage& stage, int n_runs) {
    const int outer = std::min(options_.n_threads, n_runs), inner = std::max(1, options_.n_threads / outer);
    context_.max_bytes = static_cast<long long>(0.8 * static_cast<double>(options_.max_bytes)) / outer;
    const int first = stage.f.count();
    std::vector<RunValues> runs(n_runs);
    int done = 0;
    const double began = seconds();
    parallel_for(n_runs, outer, [&](int r) {
        runs[r] = run_once(context_, stage.settings, stage.number, first + r, inner, monitor_);
        const std::lock_guard lock(mutex_);
        ++done;
        monitor_.report({static_cast<double>(done) / n_runs,
                         "runs of stage " + std::to_string(stage.number + 1), result_.report.relative_error});
    });
    seconds_per_run_ = (seconds() - began) / n_runs * outer;
    for (const RunValues& r : runs) {
        stage.f.add(r.f);
        stage.direct.add(r.direct);
        stage.remainder = std::max(stage.remainder, r.remainder);
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
        totals_.higher_orders = std::max(totals_.higher_orders, r.higher_orders);
    }
}

Measurement::Estimate Measurement::estimate(const std::vector<Stage>& stages) const {
    const size_t rows = context_.rows(), n_channels = result_.table.channels.size();
    const size_t slices = stages.back().f.mean().size() / (rows * n_channels);
    Estimate e;
    e.f.assign(stages.back().f.mean().size(), 0.0);
    e.se = e.bias = e.f;
    // Stages of the same mesh are independent estimates of the same values: they are averaged with weights
    // from their pooled variances.
    std::vector<const Stage*> used;
    for (const Stage& s : stages)
        if (s.settings.refinement == stages.back().settings.refinement && s.f.mean().size() == e.f.size())
            used.push_back(&s);
    std::vector<std::vector<std::vector<double>>> se(used.size());
    std::vector<double> weight(used.size());
    for (size_t s = 0; s < used.size(); ++s) {
        double pooled = 0;
        for (size_t slice = 0; slice < n_channels * slices; ++slice) {
            se[s].push_back(standard_errors(used[s]->f, slice * rows, groups_));
            if (slice % slices != 0) continue;
            const std::vector<double> scale =
                error_scale({used[s]->f.mean().begin() + static_cast<long>(slice * rows),
                             used[s]->f.mean().begin() + static_cast<long>((slice + 1) * rows)});
            for (size_t r = 0; r < rows; ++r)
                if (scale[r] > 0) pooled += std::pow(se[s].back()[r] / scale[r], 2);
        }
        weight[s] = 1 / std::max(pooled, 1e-30);
    }
    const double weights = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (size_t s = 0; s < used.size(); ++s)
        for (size_t i = 0; i < e.f.size(); ++i) {
            e.f[i] += weight[s] / weights * used[s]->f.mean()[i];
            e.se[i] += std::pow(weight[s] / weights * se[s][i / rows][i % rows], 2);
        }
    for (double& v : e.se) v = std::sqrt(v);

    // Bias: mesh (relative to the indirect part), the continuation of the orders, and what a skipped indirect
    // part could have added.
    double sum_total = 0, sum_random = 0, sum_bias = 0, sum_direct = 0;
    const std::vector<double> direct_se = standard_errors(stages.back().direct, 0, groups_);
    const double remainder = stages.back().remainder;
    for (size_t c = 0; c < n_channels; ++c) {
        for (size_t slice = 0; slice < slices; ++slice)
            for (size_t r = 0; r < rows; ++r) {
                const size_t i = (c * slices + slice) * rows + r;
                double indirect = e.f[i];
                if (slice == 1) indirect = 0;
                if (slice == 0) {
                    // The direct part of channel 0, scaled to this channel's share of the sum; a map's
                    // channels differ little in it.
                    const double share =
                        e.f[r] > 0 ? std::min(1.0, stages.back().direct.mean()[r] / stages.back().f.mean()[r])
                                   : 1.0;
                    indirect = slices > 1 ? e.f[i] - e.f[i + rows] : e.f[i] * (1 - share);
                }
                indirect = std::max(0.0, indirect);
                e.bias[i] =
                    std::hypot(
                        mesh_bias_.uncertainty * indirect,
                        slice == 0 ? series_continuation_error * remainder * (e.f[i] - indirect) : 0.0) +
                    (slice == 0 ? gentle_bound_ * e.f[i] : 0.0);
                e.f[i] += mesh_bias_.correction * indirect;
            }
        const std::vector<double> total(e.f.begin() + static_cast<long>(c * slices * rows),
                                        e.f.begin() + static_cast<long>((c * slices + 1) * rows));
        const std::vector<double> scale = error_scale(total);
        for (size_t r = 0; r < rows; ++r) {
            if (!(scale[r] > 0)) continue;
            const size_t i = c * slices * rows + r;
            const double random = std::pow(e.se[i] / scale[r], 2), bias = std::pow(e.bias[i] / scale[r], 2);
            sum_random += random;
            sum_bias += bias;
            sum_total += random + bias;
            if (c == 0) sum_direct += std::pow(direct_se[r] / scale[r], 2);
        }
    }
    const double n = static_cast<double>(rows * n_channels);
    e.total = std::sqrt(sum_total / n);
    e.random = std::sqrt(sum_random / n);
    e.systematic = std::sqrt(sum_bias / n);
    e.direct = std::sqrt(sum_direct / static_cast<double>(rows));
    return e;
}

// What to change so that the error falls below the target: false if nothing can.
bool Measurement::next_settings(const Stage& stage, const Estimate& e, double target, RunSettings& next,
                                int& more_runs) const {
    next = stage.settings;
    more_runs = 0;
    if (e.systematic > 0.8 * target) {
        const double unknowns =
            2.0 * scene_.surface.nx * scene_.surface.ny * std::pow(2 * next.refinement, 2);
        if (next.refinement >= 16 || unknowns > 3e7 || !context_.indirect) {
            if (e.random < 0.5 * target) return false;  // what is left cannot be refined away
        } else {
            next.refinement *= 2;
            next.directions *= 2;
            return true;
        }
    }
    const double left = std::sqrt(
                     std::max(target * target - e.systematic * e.systematic, 0.04 * target * target)),
                 excess = e.random / left;
    if (next.tiles_x > 0) {  // windows: most of the error is which part of the surface was seen
        const auto [full_x, full_y] = covering_windows();
        const double factor = std::clamp(1.15 * excess, 1.2, 4.0);
        if (next.tiles_x < full_x || next.tiles_y < full_y) {
            next.tiles_x = std::min(full_x, static_cast<int>(std::ceil(next.tiles_x * factor)));
            next.tiles_y = std::min(full_y, static_cast<int>(std::ceil(next.tiles_y * factor)));
            const double whole_cells = static_cast<double>(scene_.surface.nx) * scene_.surface.ny;
            if (next.tiles_x * next.tiles_y * window_cells() > whole_cells &&
                whole_fits(next.refinement, next) && scene_.surface.border_x == 0 &&
                scene_.surface.border_y == 0)
                next.tiles_x = next.tiles_y = 0;
            return true;
        }
    }
    if (excess < 1.6 && stage.f.count() < most_runs) {
        more_runs = std::clamp(static_cast<int>(std::ceil(stage.f.count() * (1.15 * excess * excess - 1))), 2,
                               most_runs - stage.f.count());
        return true;
    }
    const double indirect = std::sqrt(std::max(0.0, e.random * e.random - e.direct * e.direct)),
                 share = 0.65 * left;
    if (e.direct > share)
        next.sub_samples = std::min(
            4096, static_cast<int>(
                      std::ceil(next.sub_samples * std::clamp(std::pow(e.direct / share, 1.25), 1.5, 8.0))));
    if (indirect > share && context_.indirect)
        next.directions = std::min(
            1 << 14, static_cast<int>(std::ceil(next.directions *
                                                std::clamp(std::pow(indirect / share, 1 / 1.5), 1.5, 8.0))));
    return !(next == stage.settings);
}

void Measurement::measure() {
    Report& report = result_.report;
    const std::optional<Accuracy::Samples>& samples = plan_.accuracy.samples;
    std::vector<Stage> stages(1);
    stages[0].settings =
        samples ? RunSettings{samples->sub_samples, samples->directions, samples->refinement, 0, 0}
                : first_settings();
    context_.max_bytes =
        static_cast<long long>(0.8 * static_cast<double>(options_.max_bytes)) / options_.n_threads;
    if (samples && !whole_fits(samples->refinement, stages[0].settings))
        std::tie(stages[0].settings.tiles_x, stages[0].settings.tiles_y) = covering_windows();
    run_stage(stages[0], samples ? std::max(2, samples->replicates) : runs_at_first);
    if (plan_.separate_orders && plan_.max_order == 0) context_.fixed_applications = totals_.applications;

    mesh_bias_ = predict_mesh_bias(scene_.surface);
    const double wanted = target();
    auto refine_bias = [&](const Stage& stage) {
        // The two-grid run is skipped where the guess is far below what was asked for.
        const Estimate guess = estimate(stages);
        if (!context_.indirect || context_.max_order == 1) return;
        if (options_.allow_skips && 3 * guess.systematic < std::max(wanted, samples ? guess.random : 0.0)) {
            if (stage.number == 0)
                report.skipped.push_back({"two-grid run", "facets resolve the relief: mesh bias guessed at " +
                                                              number(guess.systematic)});
            return;
        }
        mesh_bias_ = measure_mesh_bias(context_, stage.settings, options_.n_threads, monitor_);
    };
    refine_bias(stages[0]);
    Estimate e = estimate(stages);
    while (true) {
        report.relative_error = e.total;
        monitor_.report({0.5, "error reached", e.total});
        if (samples || (wanted > 0 && e.total <= wanted) || static_cast<int>(stages.size()) >= most_stages)
            break;
        const double aim = wanted > 0 ? wanted : 0.5 * e.total;
        RunSettings next;
        int more_runs = 0;
        if (!next_settings(stages.back(), e, aim, next, more_runs)) break;
        if (plan_.accuracy.max_seconds) {
            // Will the next runs end in time? Their cost grows with everything that grew.
            const RunSettings& now = stages.back().settings;
            double growth = std::max({1.0, static_cast<double>(next.directions) / now.directions,
                                      static_cast<double>(next.sub_samples) / now.sub_samples}) *
                            (next.refinement > now.refinement ? 2.0 : 1.0);
            if (now.tiles_x > 0)
                growth *= next.tiles_x > 0
                              ? static_cast<double>(next.tiles_x * next.tiles_y) / (now.tiles_x * now.tiles_y)
                              : static_cast<double>(scene_.surface.nx) * scene_.surface.ny /
                                    (now.tiles_x * now.tiles_y * window_cells());
            const double n = more_runs > 0 ? more_runs : runs_at_first;
            if (seconds() + growth * seconds_per_run_ * n / std::min<double>(n, options_.n_threads) >
                *plan_.accuracy.max_seconds) {
                if (!(now == next) && stages.back().f.count() < most_runs &&
                    seconds() + 2 * seconds_per_run_ / std::min(2, options_.n_threads) <=
                        *plan_.accuracy.max_seconds)
                    more_runs = 2;  // a smaller step still fits
                else
                    break;
            }
        }
        if (more_runs > 0) {
            run_stage(stages.back(), more_runs);
        } else {
            const bool finer = next.refinement != stages.back().settings.refinement;
            stages.emplace_back();
            stages.back().settings = next;
            stages.back().number = static_cast<int>(stages.size()) - 1;
            run_stage(stages.back(), runs_at_first);
            if (finer) refine_bias(stages.back());
        }
        e = estimate(stages);
    }

    Table& table = result_.table;
    const size_t n = e.f.size();
    table.orders = static_cast<int>(n / (table.channels.size() * table.rows())) - 1;
    table.f.resize(n);
    table.se.resize(n);
    table.bias.resize(n);
    for (size_t i = 0; i < n; ++i) {
        table.f[i] = static_cast<float>(std::max(0.0, e.f[i]));
        table.se[i] = static_cast<float>(e.se[i]);
        table.bias[i] = static_cast<float>(e.bias[i]);
    }
    report.relative_error = e.total;
    report.target_met = samples.has_value() || wanted == 0 || e.total <= wanted;
    const RunSettings& last = stages.back().settings;
    int runs = 0;
    for (const Stage& s : stages) runs += s.f.count();
    report.settings = {{"transport", "diffuse operator"},
                       {"simd", simd_target()},
                       {"sub_samples", std::to_string(last.sub_samples)},
                       {"directions", std::to_string(last.directions)},
                       {"refinement", std::to_string(last.refinement)},
                       {"windows", last.tiles_x == 0 ? "whole period"
                                                     : std::to_string(last.tiles_x * last.tiles_y) + " of " +
                                                           std::to_string(tile_core) + " x " +
                                                           std::to_string(tile_core) + " cells a run"},
                       {"runs", std::to_string(stages.back().f.count()) + " (" + std::to_string(runs) +
                                    " in " + std::to_string(stages.size()) + " stages)"},
                       {"mesh_bias", mesh_bias_.measured ? "two grids: indirect part corrected by " +
                                                               number(100 * mesh_bias_.correction) + " %"
                                                         : "guessed from the relief"},
                       {"relative_error", number(e.total)}};
    report.counters = {
        {"rays", totals_.rays},
        {"rays skipped (steeper than the relief)", totals_.rays_skipped},
        {"links", totals_.links},
        {"links substituted at window borders", totals_.substituted},
        {"links dropped at window borders", totals_.dropped},
        {"nearly horizontal bundles given up", static_cast<double>(totals_.truncated_bundles)}};
    report.seconds = {{"visibility and direct light", totals_.seconds_direct},
                      {"operator", totals_.seconds_links},
                      {"orders of scattering", totals_.seconds_series},
                      {"wall", seconds()}};
    if (totals_.rays_skipped > 0)
        report.skipped.push_back({"shadow tests of steep directions", "they are steeper than every facet"});
    if (last.tiles_x > 0)
        report.skipped.push_back({"most receivers", "windows of the surface reach the error asked for"});
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
    return Measurement(surface, std::get<Lambertian>(material.reflectance), material, plan, options, monitor)
        .run();
}

}  // namespace gonio
