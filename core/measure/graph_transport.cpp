#include "measure/graph_transport.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "measure/cell_views.h"
#include "measure/describe.h"
#include "measure/graph_mesh.h"
#include "measure/shard_bytes.h"
#include "measure/stage_average.h"
#include "measure/windows.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr int least_directions = 16;
// Directions may grow to so many times what they are at first, and with them the chains of samples that meet
// a view: where those are too few even then, an error is what it is.
constexpr double most_growth = 256;
constexpr double few_chains = 25;  // that leave a fifth of the mean

int first_sampled(const GraphContext& context, const RunSettings& settings) {
    return first_sampled_order(context, run_tiles(context, settings, 0, 0).front(), settings.directions);
}

// That shift, relative to the table as e.random is.
double shared_directions_bias(const GraphContext& context, const Stage& stage, const Estimate& e) {
    // Orders 3 and up that are followed along lobes use no direction twice.
    if (!context.transports() || first_sampled(context, stage.settings) > 0) return 0;
    return shared_directions_doubt * std::sqrt(static_cast<double>(stage.f.count())) *
           safe_sqrt(e.random * e.random - e.direct * e.direct);
}

}  // namespace

GraphTransport::GraphTransport(const MeasuredScene& scene, Report& report) {
    static_cast<MeasuredScene&>(context_) = scene;
    context_.channel_groups = channel_groups(*scene.material);
    const BrdfPlan& plan = *scene.plan;
    const double target = plan.accuracy.target();
    if (context_.channel_groups.size() < scene.n_channels())
        report.skipped.push_back({"all channels but " + std::to_string(context_.channel_groups.size()),
                                  "the others reflect in proportion: their orders are multiples"});
    // Of the light of a facet, at most this share comes from other facets if it is diffuse: they stand within
    // the slab |z| <= L / sqrt(1 + L^2). A lobe can send all of it that way, so here it is skipped only where
    // no ray can hit anything.
    const double slope = scene.grid->max_slope;
    if (scene.allow_skips && slope < 1e-9) {
        context_.indirect = false;
        report.skipped.push_back({"indirect light", "the surface is a plane"});
    }
    // Or a hundredth of what so many directions leave.
    const Accuracy& accuracy = plan.accuracy;
    context_.series_tolerance =
        std::clamp(accuracy.samples ? 5e-3 / accuracy.samples->directions : 0.02 * target, 1e-6, 1e-4);
    if (plan.max_order == 1) report.skipped.push_back({"indirect light", "max_order is 1"});
    context_.single_orders = plan.separate_orders ? plan.max_order : 0;
}

RunSettings GraphTransport::first_settings(double target) const {
    RunSettings settings{1, 64, 1, 0, 0};
    if (target < 0.003) settings.directions = 128;
    if (static_cast<double>(context_.surface->nx) * context_.surface->ny >
        1.5 * std::pow(tile_core + 2.0 * tile_halo, 2))
        settings.tiles_x = settings.tiles_y = 1;
    return settings;
}

RunSettings GraphTransport::settings_of(const Accuracy::Samples& samples) const {
    RunSettings settings{samples.sub_samples, samples.directions, samples.refinement, 0, 0};
    if (!fits(settings)) std::tie(settings.tiles_x, settings.tiles_y) = covering_windows(context_);
    const int least = least_directions * samples.refinement * samples.refinement;
    if (samples.directions < least && context_.indirect)
        throw Error(ErrorCode::invalid_input, "/accuracy/samples/directions",
                    std::to_string(samples.directions),
                    "needs at least 16 refinement^2 = " + std::to_string(least));
    return settings;
}

double GraphTransport::least_bytes(const RunSettings& settings) const {
    return graph_run_bytes(context_, settings, std::min<int>(64, static_cast<int>(context_.lights.size())),
                           std::min<int>(64, static_cast<int>(context_.views.size())));
}

double GraphTransport::wanted_bytes(const RunSettings& settings) const {
    const int n_views = context_.view_to_light.empty() ? views_of_run(context_, settings) : 0;
    return graph_run_bytes(context_, settings, static_cast<int>(context_.lights.size()), n_views);
}

bool GraphTransport::fits(const RunSettings& settings) const {
    return least_bytes(settings) < static_cast<double>(context_.max_bytes);
}

RunValues GraphTransport::run(const RunSettings& settings, int stage, int run, int n_threads,
                              const Monitor& monitor) const {
    return run_with_cells(context_, settings, stage, run,
                          [&](const GraphContext& context, const RunSettings& at_place) {
                              return graph_run(context, at_place, stage, run, n_threads, monitor);
                          });
}

std::string GraphTransport::settings_key(const RunSettings& settings) const {
    return gonio::settings_key(
        TransportKind::pair_graph, settings,
        {static_cast<double>(context_.indirect), static_cast<double>(context_.allow_skips),
         static_cast<double>(!context_.view_to_light.empty()), static_cast<double>(context_.single_orders),
         static_cast<double>(context_.max_bytes), context_.series_tolerance});
}

void GraphTransport::fix_orders(const RunValues& first) {
    if (context_.single_orders == 0) context_.single_orders = first.higher_orders + 1;
}

// The two-grid runs are skipped where a guess from the relief is far below what was asked for.
void GraphTransport::find_bias(const std::vector<Stage>& stages, const SideWork& side, Report& report) {
    if (!context_.transports()) return;
    if (later_.empty() && sampling(stages.back()).lobes)
        later_ = trace_later_light(*context_.surface, *context_.material, context_.lights,
                                   context_.plan->max_order, context_.plan->accuracy.seed, side.n_threads,
                                   side.monitor);
    mesh_doubt_ = predict_mesh_bias(*context_.surface).guess;
    const Estimate guessed = estimate(stages);
    const Accuracy& accuracy = context_.plan->accuracy;
    const double guess =
        safe_sqrt(guessed.systematic * guessed.systematic - guessed.rare * guessed.rare) - guessed.unresolved;
    if (context_.allow_skips &&
        2 * guess < std::max(accuracy.target(), accuracy.samples ? guessed.random : 0.0)) {
        if (stages.size() == 1)
            report.skipped.push_back(
                {"two-grid run", "facets resolve the relief: mesh bias guessed at " + number(guess)});
        return;
    }
    const std::string bytes = side.kept(stages.back(), "mesh", [&] {
        return to_bytes(measure_graph_mesh(context_, stages.back().settings, side.n_threads, side.monitor));
    });
    mesh_doubt_ = number_from(bytes);
    mesh_measured_ = true;
}

GraphTransport::Sampling GraphTransport::sampling(const Stage& stage) const {
    const RunSettings& settings = stage.settings;
    const Tile tile = run_tiles(context_, settings, 0, 0).front();
    Sampling sampling;
    sampling.lobes = narrow_lobes(*context_.material, *context_.grid, tile, settings.directions);
    sampling.first_sampled = first_sampled_order(context_, tile, settings.directions);
    // Of a cell every place is a view of its own.
    const double places = context_.plan->outgoing_cells.empty() ? 1 : directions_per_cell(settings),
                 facets = 2 * tile.core_area() * std::max(1, settings.tiles_x * settings.tiles_y) *
                          stage.f.count() * places;
    sampling.facets = facets * tile.n_parts();
    sampling.pairs = facets * pairs_per_facet(*context_.surface, tile, settings.directions);
    sampling.rays = facets * sampled_rays_per_facet(settings);
    return sampling;
}

std::vector<double> GraphTransport::chains(const Sampling& sampling, const std::vector<double>& later) {
    std::vector<double> all = chains_of_pairs(sampling.lobes, later, sampling.pairs, sampling.facets);
    if (sampling.first_sampled > 0) {
        const std::vector<double> of_rays = chains_of_rays(sampling.lobes, later, sampling.rays);
        for (size_t k = sampling.first_sampled - 2; k < all.size(); ++k) all[k] = of_rays[k];
    }
    return all;
}

void GraphTransport::add_rare(const Stage& stage, const std::vector<double>& indirect, Estimate& e) const {
    if (later_.empty()) return;
    const Sampling of = sampling(stage);
    if (!of.lobes) return;
    const size_t rows = context_.rows(), n_channels = context_.n_channels(),
                 slices = e.f.size() / (rows * n_channels);
    double squares = 0;
    for (size_t c = 0; c < n_channels; ++c) {
        const auto sum = e.f.begin() + static_cast<long>(c * slices * rows);
        const std::vector<double> scale = error_scale({sum, sum + static_cast<long>(rows)});
        std::vector<std::vector<double>> met;
        for (const auto& light : later_) met.push_back(chains(of, light[c]));
        for (size_t slice = 0; slice < slices; ++slice) {
            if (slice == 1) continue;  // the first order is exact
            for (size_t r = 0; r < rows; ++r) {
                const size_t i = (c * slices + slice) * rows + r;
                const int light = context_.groups.light[r];
                const double least = undersampled(of.lobes, later_[light][c], met[light],
                                                  static_cast<int>(slice), indirect[i]);
                // What the scatter tells already is not told twice; of few runs it is uncertain itself, so
                // that up to 0.7 times what it should be it is not taken for luck.
                const double rare = safe_sqrt(least * least - 2 * e.se[i] * e.se[i]);
                e.bias[i] = std::hypot(e.bias[i], rare);
                if (slice == 0 && scale[r] > 0) squares += std::pow(rare / scale[r], 2);
            }
        }
    }
    e.rare = std::sqrt(squares / static_cast<double>(rows * n_channels));
}

double GraphTransport::most_chains(const Sampling& sampling) const {
    double most = 0;
    for (const auto& light : later_)
        for (const auto& channel : light)
            if (!channel.empty()) most = std::max(most, chains(sampling, channel)[0]);
    return most;
}

Estimate GraphTransport::estimate(const std::vector<Stage>& stages) const {
    Estimate e = average_stages(context_, stages);
    const Stage& last = stages.back();
    const size_t rows = context_.rows(), n_channels = context_.n_channels(),
                 slices = e.f.size() / (rows * n_channels);
    summarise(context_, last, 0, 1, e);
    const double shared_share = e.random > 0 ? shared_directions_bias(context_, last, e) / e.random : 0.0;
    const int max_order = context_.plan->max_order;
    std::vector<double> indirects(e.f.size());
    for (size_t c = 0; c < n_channels; ++c)
        for (size_t slice = 0; slice < slices; ++slice)
            for (size_t r = 0; r < rows; ++r) {
                const size_t i = (c * slices + slice) * rows + r, sum = c * slices * rows + r;
                const double f = e.f[i], total = e.f[sum];
                // Of channel 0, and in proportion of the others.
                const double direct_0 = last.direct.mean()[r], total_0 = e.f[r],
                             direct = slices > 1    ? e.f[sum + rows]
                                      : total_0 > 0 ? direct_0 / total_0 * total
                                                    : 0.0;
                const double indirect = slice == 1 ? 0.0 : slice == 0 ? std::max(0.0, f - direct) : f;
                indirects[i] = indirect;
                const double left_out = slice == 0 ? last.remainder * (direct + 2 * indirect) : 0.0;
                const bool reuses = context_.transports() && max_order != 2 && slice != 1 && slice != 2;
                const double shared = reuses ? shared_share * e.se[i] : 0.0;
                e.bias[i] = std::hypot(mesh_doubt_ * indirect, left_out, shared) + e.hidden[i];
            }
    add_rare(last, indirects, e);
    summarise(context_, last, 0, 1, e);
    return e;
}

NextStep GraphTransport::next_step(const Stage& stage, const Estimate& e, double target) const {
    NextStep step{true, 0, stage.settings};
    RunSettings& next = step.settings;
    const double shared = shared_directions_bias(context_, stage, e),
                 // More samples take away what too few of them meet as they do the scatter of those.
        random = std::hypot(e.random, e.rare),
                 mesh = safe_sqrt(e.systematic * e.systematic - shared * shared - e.rare * e.rare);
    if (e.rare > target) {
        const double met = most_chains(sampling(stage));
        if (1 + most_growth * met < std::pow(e.rare / target, 2) * (1 + met))
            return {false, 0, stage.settings};
    }
    if (const auto slivers = more_sub_samples(context_, stage, e, target)) return *slivers;
    if (mesh - e.unresolved > 0.8 * target) {
        RunSettings finer = next;
        finer.refinement *= 2;
        finer.directions *= 4;
        if (context_.transports() && mesh_measured_ && finer.refinement <= 8 && fits(finer)) {
            next = finer;
            return step;
        }
    }
    if (mesh > 0.8 * target && random < 0.5 * target)
        return {false, 0, stage.settings};  // it cannot be refined away
    const double left = std::sqrt(std::max(target * target - mesh * mesh, 0.04 * target * target));
    const double left_random = std::sqrt(std::max(left * left - shared * shared, 0.04 * left * left)),
                 excess = random / left_random;
    if (const auto windows =
            more_windows(context_, stage, excess, [&](const RunSettings& s) { return fits(s); }))
        return *windows;
    if (excess < 1.6 && shared < 0.7 * left && stage.f.count() < most_runs) {
        step.more_runs =
            std::clamp(static_cast<int>(std::ceil(stage.f.count() * (1.15 * excess * excess - 1))), 2,
                       most_runs - stage.f.count());
        return step;
    }
    // Measured (shared/performance_glossy A1, A2): the direct error falls as n^-0.6, that of the orders
    // beyond as n^-1.2.
    const double indirect = std::hypot(safe_sqrt(random * random - e.direct * e.direct), shared),
                 share = 0.65 * left;
    if (e.direct > share)
        next.sub_samples = grown(next.sub_samples, e.direct / share, 0.6, most_direct_samples);
    if (indirect > share && context_.transports()) {
        RunSettings more = next;
        // Rays along lobes gain by more of them what they would by more runs.
        const double order = first_sampled(context_, next) == 2 ? 0.5 : 1.1;
        more.directions = grown(next.directions, indirect / share, order, 1 << 14);
        if (fits(more)) next = more;
    }
    if (next == stage.settings && stage.f.count() < most_window_runs) step.more_runs = runs_at_first;
    step.possible = step.more_runs > 0 || !(next == stage.settings);
    return step;
}

RunForecast GraphTransport::forecast(const RunSettings& settings) const {
    return forecast_graph(context_, settings);
}

double GraphTransport::relative_cost(const RunSettings& settings, const RunSettings& reference) const {
    const double samples = std::max(static_cast<double>(settings.directions) / reference.directions,
                                    static_cast<double>(settings.sub_samples) / reference.sub_samples);
    return samples * worked_cells(context_, settings) / worked_cells(context_, reference) *
           std::pow(static_cast<double>(settings.refinement) / reference.refinement, 2);
}

void GraphTransport::describe(const std::vector<Stage>& stages, const RunValues& totals,
                              Report& report) const {
    const Stage& last = stages.back();
    describe_settings(stages, report);
    report.settings.push_back({"orders", std::to_string(totals.applications + 1)});
    describe_turn(totals, report);
    report.settings.push_back({"mesh_bias", (mesh_measured_ ? "two grids: " : "guessed from the relief: ") +
                                                number(100 * mesh_doubt_) + " % of the orders beyond 1"});
    report.settings.push_back({"relative_error", number(report.relative_error)});
    report.counters = {{"rays", totals.rays},
                       {"rays skipped (steeper than the relief)", totals.rays_skipped},
                       {"pairs", totals.links},
                       {"pairs substituted at window borders", totals.substituted},
                       {"pairs dropped at window borders", totals.dropped},
                       {"nearly horizontal bundles given up", static_cast<double>(totals.truncated_bundles)},
                       {"largest share that one pair passes on", totals.heaviest}};
    report.seconds = {{"visibility and direct light", totals.seconds_direct},
                      {"pairs", totals.seconds_links},
                      {"orders of scattering", totals.seconds_series}};
    describe_skips(context_, last, totals, report);
    if (!context_.transports()) return;
    const Sampling of = sampling(last);
    if (of.first_sampled > 0)
        report.settings.push_back(
            {"sampled_orders",
             (of.first_sampled == 2 ? "2 and up" : "3 and up") +
                 std::string(
                     ": by rays along lobes, which are narrower than the shared directions are dense")});
    if (const double met = most_chains(of); of.lobes && met < few_chains)
        report.warnings.push_back(
            "the lobes are so much narrower than the shared directions are dense that only " + number(met) +
            " chains of samples meet a view on average: the biases hold the light of orders 2 and up that "
            "single values may miss; more \"directions\", or receiver cells, do better");
    const Tile tile = run_tiles(context_, last.settings, 0, 0).front();
    if (const double share =
            lobe_share_of_pair(*context_.material, *context_.grid, tile, last.settings.directions);
        share > most_honest_share && !of.lobes && context_.plan->separate_orders)
        report.warnings.push_back(
            "the lobes are narrower than the shared directions are dense (the peak of one sends a pair " +
            number(share) +
            " times what it got): orders 3 and up alone have heavier tails than the stated errors tell; more "
            "\"directions\" do better");
}

}  // namespace gonio
