#include "measure/planning.h"

#include <algorithm>
#include <cmath>

#include "measure/windows.h"
#include "surface/facet_mesh.h"

namespace gonio {

double rms_slope(const HeightField& s) {
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

namespace {

double cells(const MeasuredScene& scene) {
    return static_cast<double>(scene.surface->nx) * scene.surface->ny;
}
double window_cells() {
    return std::pow(tile_core + 2.0 * tile_halo, 2);
}

}  // namespace

double worked_cells(const MeasuredScene& scene, const RunSettings& s) {
    return s.tiles_x == 0 ? cells(scene) : s.tiles_x * s.tiles_y * window_cells();
}

std::pair<int, int> covering_windows(const MeasuredScene& scene) {
    const HeightField& s = *scene.surface;
    auto count = [](int n) { return std::max(1, (n + tile_core - 1) / tile_core); };
    return {count(s.nx - 2 * s.border_x), count(s.ny - 2 * s.border_y)};
}

bool run_fits(const RunContext& context, const RunSettings& settings) {
    const int views = context.view_to_light.empty() ? static_cast<int>(context.views.size()) : 0;
    return run_bytes(context, settings, static_cast<int>(context.lights.size()), views) <
           static_cast<double>(context.max_bytes);
}

double relative_cost(const RunContext& context, const RunSettings& settings, const RunSettings& reference) {
    const double samples = std::max(static_cast<double>(settings.directions) / reference.directions,
                                    static_cast<double>(settings.sub_samples) / reference.sub_samples);
    const double refinement = static_cast<double>(settings.refinement) / reference.refinement;
    return samples * refinement * worked_cells(context, settings) / worked_cells(context, reference);
}

// Measured at slope 0.7 and 32768 facets: direct error 0.11 % with one sub-sample,
// indirect error 0.75 % with 16 directions, falling as n^-1.7. What it gets wrong, the stages mend.
RunSettings first_settings(const RunContext& context, double target) {
    RunSettings settings;
    const double slope = std::clamp(rms_slope(*context.surface), 0.05, 3.0), wanted = std::max(target, 1e-5);
    double measured_cells = cells(context);
    if (measured_cells > 1.5 * window_cells()) {
        settings.tiles_x = settings.tiles_y = 1;
        measured_cells = tile_core * tile_core;
    }
    const double share =
        0.6 * wanted * std::sqrt(static_cast<double>(runs_at_first)) / student_one_sigma(runs_at_first + 4);
    const double direct = 0.0011 * (slope / 0.7) * std::sqrt(16384 / measured_cells),
                 indirect = 0.0075 * std::pow(slope / 0.7, 1.5);
    settings.sub_samples = std::clamp(static_cast<int>(std::ceil(std::pow(direct / share, 1.25))), 1, 64);
    // Few facets average little: the operator of a single row needs more directions, and they cost little
    // there.
    const double few_facets = std::max(1.0, std::sqrt(16384 / measured_cells));
    settings.directions = std::clamp(
        static_cast<int>(16 * few_facets * std::ceil(std::pow(indirect / share, 1 / 1.7))), 16, 1024);
    return settings;
}

int grown(int n, double excess, double order, int most) {
    return std::min(most, static_cast<int>(std::ceil(n * std::clamp(std::pow(excess, 1 / order), 1.5, 8.0))));
}

std::optional<NextStep> more_sub_samples(const MeasuredScene& scene, const Stage& stage, const Estimate& e,
                                         double target) {
    constexpr double most_points = 1 << 22;  // a run and facet class: seconds for a hundred directions
    if (e.unresolved <= 0.5 * target) return std::nullopt;
    NextStep step{true, 0, stage.settings};
    int& n = step.settings.sub_samples;
    const double parts = worked_cells(scene, stage.settings) * std::pow(stage.settings.refinement, 2);
    const int most = static_cast<int>(std::min<double>(most_direct_samples, most_points / parts));
    if (n >= most) return std::nullopt;
    // The sequence is even: shares of a facet are known to about 1 / n.
    n = grown(n, e.unresolved / (0.5 * target), 1, most);
    return step;
}

std::optional<NextStep> more_windows(const MeasuredScene& scene, const Stage& stage, double excess,
                                     const std::function<bool(const RunSettings&)>& fits) {
    if (stage.settings.tiles_x == 0) return std::nullopt;
    NextStep step{true, 0, stage.settings};
    RunSettings& next = step.settings;
    const auto [full_x, full_y] = covering_windows(scene);
    const double runs_needed = std::ceil(1.2 * stage.f.count() * excess * excess);
    if (runs_needed <= most_window_runs) {
        step.more_runs = std::max(1, static_cast<int>(runs_needed) - stage.f.count());
        return step;
    }
    if (next.tiles_x >= full_x && next.tiles_y >= full_y) return std::nullopt;
    const double windows = std::ceil(runs_needed * next.tiles_x * next.tiles_y / runs_at_first);
    const double shape = static_cast<double>(full_x) / full_y;
    next.tiles_x = std::clamp(static_cast<int>(std::ceil(std::sqrt(windows * shape))), 1, full_x);
    next.tiles_y = std::clamp(static_cast<int>(std::ceil(windows / next.tiles_x)), 1, full_y);
    RunSettings whole = next;
    whole.tiles_x = whole.tiles_y = 0;
    const bool open = scene.surface->border_x > 0 || scene.surface->border_y > 0;
    if (!open && worked_cells(scene, next) > cells(scene) && fits(whole)) next = whole;
    return step;
}

NextStep next_step(const RunContext& context, const Stage& stage, const Estimate& e, double target) {
    NextStep step{false, 0, stage.settings};
    RunSettings& next = step.settings;
    auto decided = [&] {
        step.possible = true;
        return step;
    };
    if (const auto slivers = more_sub_samples(context, stage, e, target)) return *slivers;
    if (e.systematic - e.unresolved > 0.8 * target) {
        RunSettings finer = next;
        finer.refinement *= 2;
        finer.directions *= 4;  // each part keeps its number of directions: fewer would sample K too noisily
        if (context.indirect && finer.refinement <= 16 && run_fits(context, finer)) {
            next = finer;
            return decided();
        }
    }
    if (e.systematic > 0.8 * target && e.random < 0.5 * target)
        return step;  // what is left cannot be refined away
    const double left =
        std::sqrt(std::max(target * target - e.systematic * e.systematic, 0.04 * target * target));
    const double excess = e.random / left;
    if (const auto windows =
            more_windows(context, stage, excess, [&](const RunSettings& s) { return run_fits(context, s); }))
        return *windows;
    if (excess < 1.6 && stage.f.count() < most_runs) {
        step.more_runs =
            std::clamp(static_cast<int>(std::ceil(stage.f.count() * (1.15 * excess * excess - 1))), 2,
                       most_runs - stage.f.count());
        return decided();
    }
    const double indirect = std::sqrt(std::max(0.0, e.random * e.random - e.direct * e.direct)),
                 share = 0.65 * left;
    if (e.direct > share)
        next.sub_samples = grown(next.sub_samples, e.direct / share, 0.8, most_direct_samples);
    if (indirect > share && context.indirect)
        next.directions = grown(next.directions, indirect / share, 1.5, 1 << 14);
    step.possible = !(next == stage.settings);
    return step;
}

}  // namespace gonio
