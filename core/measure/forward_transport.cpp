#include "measure/forward_transport.h"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "base/random.h"
#include "measure/describe.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr int most_sub_samples = 1024;
// Error falls as rays^-0.65 with more places inside the facets (measured: 0.70, 0.44, 0.27, 0.11 % with 1, 2,
// 4, 16 at slope 0.5), but only as rays^-0.5 with more runs.
constexpr double order_of_convergence = 0.65;

double cpu_seconds() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// A cell that no ray, or one, ended in shows no spread, but is not known to be dark. What one ray carries
// follows from all cells of its light, for counts of rays vary as Poisson's do: variance over mean. That much
// is added to the standard errors `se` of f, [light][cell].
void add_doubt_of_one_ray(const double* f, const std::vector<double>& projected_sr, std::vector<double>& se) {
    const size_t n_cells = projected_sr.size();
    for (size_t first = 0; first < se.size(); first += n_cells) {
        double flux = 0, variance = 0;
        for (size_t cell = 0; cell < n_cells; ++cell) {
            flux += f[first + cell] * projected_sr[cell];
            variance += std::pow(se[first + cell] * projected_sr[cell], 2);
        }
        if (!(flux > 0)) continue;
        for (size_t cell = 0; cell < n_cells; ++cell)
            se[first + cell] = std::hypot(se[first + cell], variance / flux / projected_sr[cell]);
    }
}

}  // namespace

ForwardTransport::ForwardTransport(const MeasuredScene& scene)
    : scene_(scene), single_orders_(scene.plan->separate_orders ? scene.plan->max_order : 0) {
    for (const ReceiverCell& cell : scene.plan->outgoing_cells)
        projected_sr_.push_back(projected_solid_angle(cell));
}

RunSettings ForwardTransport::first_settings(double /*target*/) const {
    // A hundred thousand facets see most of what a relief has; more of a large one only if the error asks for
    // them.
    RunSettings settings;
    const double cells = static_cast<double>(scene_.surface->nx) * scene_.surface->ny;
    settings.block_step = std::max(1, static_cast<int>(cells / (size_t{1} << 16)));
    return settings;
}

RunSettings ForwardTransport::settings_of(const Accuracy::Samples& samples) const {
    RunSettings settings;
    settings.sub_samples = samples.sub_samples;
    return settings;
}

double ForwardTransport::least_bytes(const RunSettings& /*settings*/) const {
    const double values = static_cast<double>(scene_.rows() * scene_.n_channels());
    return ForwardScene::estimated_bytes(*scene_.surface) + values * (8 * 16 + 4 * 16);
}

double ForwardTransport::wanted_bytes(const RunSettings& settings) const {
    return least_bytes(settings);
}

RunValues ForwardTransport::run(const RunSettings& settings, int stage, int run, int n_threads,
                                const Monitor& monitor) const {
    const uint64_t seed = scene_.plan->accuracy.seed,
                   stream = static_cast<uint64_t>(stage) << 32 | static_cast<uint32_t>(run);
    const size_t n_lights = scene_.lights.size(), n_cells = projected_sr_.size(),
                 n_channels = scene_.n_channels(), n_rows = scene_.rows();
    const double clock = cpu_seconds();
    std::vector<ForwardTally> tallies(n_lights);
    parallel_for(static_cast<int>(n_lights), n_threads, [&](int l) {
        const auto words =
            random_words(seed, stream, (static_cast<uint64_t>(l) + 1) << 40 | uint64_t{1} << 39);
        ForwardSettings forward;
        forward.sub_samples =
            shifted_sub_samples(settings.sub_samples, uniform_double(words[0]), uniform_double(words[1]));
        forward.block_step = settings.block_step;
        forward.first_block = static_cast<int>(words[2] % static_cast<uint32_t>(settings.block_step));
        forward.max_order = scene_.plan->max_order;
        forward.skip_steep = scene_.allow_skips;
        tallies[l] = trace_light(*forward_, scene_.lights[l], forward, seed, stream, l, monitor);
    });

    RunValues values;
    size_t n_orders = 1;
    for (const ForwardTally& t : tallies) n_orders = std::max(n_orders, t.share.size());
    values.higher_orders = static_cast<int>(n_orders) - 1;
    const size_t single = single_orders_ > 0 ? static_cast<size_t>(single_orders_) : n_orders,
                 slices = scene_.plan->separate_orders ? single + 1 : 1;
    values.f.assign(n_channels * slices * n_rows, 0.0f);
    values.direct.assign(n_rows, 0.0f);
    values.projected_views.assign(n_cells, 1.0f);
    for (size_t l = 0; l < n_lights; ++l) {
        const ForwardTally& t = tallies[l];
        for (size_t c = 0; c < n_channels; ++c)
            for (size_t cell = 0; cell < n_cells; ++cell) {
                double sum = 0;
                for (size_t order = 0; order < t.share.size(); ++order) {
                    const double f = t.share[order][c * n_cells + cell] / projected_sr_[cell];
                    sum += f;
                    if (order + 1 < slices)
                        values.f[(c * slices + order + 1) * n_rows + l * n_cells + cell] =
                            static_cast<float>(f);
                    if (order == 0 && c == 0) values.direct[l * n_cells + cell] = static_cast<float>(f);
                }
                values.f[c * slices * n_rows + l * n_cells + cell] = static_cast<float>(sum);
            }
        for (const double left : t.remainder) values.remainder = std::max(values.remainder, left);
        values.projected_lights.push_back(static_cast<float>(t.projected));
        values.rays += t.rays;
        values.dropped += t.rays_lost;
        values.links += t.rays_marched;
        values.truncated_bundles += t.truncated_bundles;
    }
    values.seconds_direct = cpu_seconds() - clock;
    return values;
}

std::string ForwardTransport::settings_key(const RunSettings& settings) const {
    return gonio::settings_key(
        TransportKind::forward, settings,
        {static_cast<double>(scene_.allow_skips), static_cast<double>(single_orders_)});
}

void ForwardTransport::fix_orders(const RunValues& first) {
    if (single_orders_ == 0) single_orders_ = first.higher_orders + 1;
}

void ForwardTransport::begin_stage(const Stage& /*stage*/, int /*n_runs*/) {
    if (!forward_)
        forward_.emplace(*scene_.surface, *scene_.grid, *scene_.material, scene_.plan->outgoing_cells,
                         scene_.axes_swapped);
}

Estimate ForwardTransport::estimate(const std::vector<Stage>& stages) const {
    const size_t rows = scene_.rows(), n_channels = scene_.n_channels(), size = stages.back().f.mean().size(),
                 slices = size / (rows * n_channels);
    const bool whole = scene_.surface->border_x == 0 && scene_.surface->border_y == 0;
    Estimate e;
    e.f.assign(size, 0.0);
    e.se = e.bias = e.f;
    // Stages are independent: weighed by their rays, which is how their variances go.
    std::vector<double> weight;
    for (const Stage& s : stages)
        weight.push_back(std::pow(static_cast<double>(s.settings.sub_samples) / s.settings.block_step,
                                  2 * order_of_convergence) *
                         s.f.count());
    const double all = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (size_t s = 0; s < stages.size(); ++s) {
        const double share = weight[s] / all;
        for (size_t slice = 0; slice < n_channels * slices; ++slice) {
            std::vector<double> se = standard_errors(stages[s].f, slice * rows, scene_.groups);
            add_doubt_of_one_ray(&stages[s].f.mean()[slice * rows], projected_sr_, se);
            for (size_t r = 0; r < rows; ++r) {
                const size_t i = slice * rows + r;
                const double f = stages[s].f.mean()[i];
                e.f[i] += share * f;
                e.se[i] += std::pow(share * se[r], 2);
                // What was still on its way may end anywhere; what no sample met, too.
                if (slice % slices == 0) e.bias[i] += share * stages[s].remainder / pi;
                if (whole)
                    e.bias[i] += share * f *
                                 unresolved_share(stages[s].projected_lights.mean()[scene_.groups.light[r]]);
            }
        }
    }
    for (double& v : e.se) v = std::sqrt(v);
    double random = 0, systematic = 0;
    for (size_t c = 0; c < n_channels; ++c) {
        const auto first = e.f.begin() + static_cast<long>(c * slices * rows);
        const std::vector<double> scale = error_scale({first, first + static_cast<long>(rows)});
        for (size_t r = 0; r < rows; ++r) {
            if (!(scale[r] > 0)) continue;
            random += std::pow(e.se[c * slices * rows + r] / scale[r], 2);
            systematic += std::pow(e.bias[c * slices * rows + r] / scale[r], 2);
        }
    }
    const double n = static_cast<double>(rows * n_channels);
    e.random = std::sqrt(random / n);
    e.systematic = std::sqrt(systematic / n);
    e.total = std::hypot(e.random, e.systematic);
    e.direct = e.random;
    return e;
}

NextStep ForwardTransport::next_step(const Stage& stage, const Estimate& estimate, double target) const {
    NextStep step;
    if (estimate.systematic >= target) return step;
    const double random_target = std::sqrt(target * target - estimate.systematic * estimate.systematic),
                 excess = 1.05 * estimate.random / random_target;
    const int runs = stage.f.count(), wanted_runs = static_cast<int>(std::ceil(runs * excess * excess));
    step.possible = true;
    if (wanted_runs <= most_runs ||
        (stage.settings.sub_samples >= most_sub_samples && runs < most_window_runs)) {
        step.more_runs = std::max(1, std::min(wanted_runs, most_window_runs) - runs);
        return step;
    }
    const double factor = std::clamp(std::pow(excess, 1 / order_of_convergence), 2.0, 16.0);
    step.settings = stage.settings;
    if (stage.settings.block_step > 1) {
        step.settings.block_step = std::max(1, static_cast<int>(stage.settings.block_step / factor));
    } else {
        step.settings.sub_samples =
            std::min(most_sub_samples, static_cast<int>(std::ceil(stage.settings.sub_samples * factor)));
        step.possible = step.settings.sub_samples > stage.settings.sub_samples;
    }
    return step;
}

RunForecast ForwardTransport::forecast(const RunSettings& settings) const {
    return forecast_forward(scene_, settings);
}

double ForwardTransport::relative_cost(const RunSettings& settings, const RunSettings& reference) const {
    return static_cast<double>(settings.sub_samples) * reference.block_step /
           (static_cast<double>(reference.sub_samples) * settings.block_step);
}

void ForwardTransport::describe(const std::vector<Stage>& stages, const RunValues& totals,
                                Report& report) const {
    const Stage& last = stages.back();
    int runs = 0;
    for (const Stage& s : stages) runs += s.f.count();
    report.settings.insert(report.settings.end(),
                           {{"simd", simd_target()},
                            {"sub_samples", std::to_string(last.settings.sub_samples)},
                            {"runs", std::to_string(last.f.count()) + " (" + std::to_string(runs) + " in " +
                                         std::to_string(stages.size()) + " stages)"},
                            {"receivers", std::to_string(projected_sr_.size()) + " cells"},
                            {"light left over", number(last.remainder)},
                            {"relative_error", number(report.relative_error)}});
    report.counters = {{"rays", totals.rays},
                       {"shadow rays", totals.links},
                       {"rays given up", totals.dropped},
                       {"nearly horizontal bundles given up", static_cast<double>(totals.truncated_bundles)}};
    report.seconds = {{"forward tracing", totals.seconds_direct}};
    if (last.settings.block_step > 1)
        report.skipped.push_back(
            {"most facets as starting points",
             "one of " + std::to_string(last.settings.block_step) + " blocks reaches the error asked for"});
}

}  // namespace gonio
