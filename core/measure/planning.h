// How many sub-samples, directions, windows and runs: a first guess from the relief, then whatever dominates
// the error.
#pragma once
#include <functional>
#include <optional>

#include "measure/estimate.h"

namespace gonio {

inline constexpr int runs_at_first = 6, most_runs = 16, most_window_runs = 32;
inline constexpr int most_direct_samples = 4096;

// Of a sample of the facets.
double rms_slope(const HeightField& surface);

RunSettings first_settings(const RunContext& context, double target);

// Cells that one run works on.
double worked_cells(const MeasuredScene& scene, const RunSettings& settings);
// Windows that cover the surface once, along x and y.
std::pair<int, int> covering_windows(const MeasuredScene& scene);
// Whether one run at these settings fits context.max_bytes.
bool run_fits(const RunContext& context, const RunSettings& settings);
// Work of a run relative to another's.
double relative_cost(const RunContext& context, const RunSettings& settings, const RunSettings& reference);

struct NextStep {
    bool possible = false;  // false: nothing that could be changed would help
    int more_runs = 0;      // > 0: at the same settings; 0: a new stage at `settings`
    RunSettings settings;
};
// n, times what brings a part of the error down by `excess` if it falls as n^-order: 1.5 to 8 times, at most
// `most`.
int grown(int n, double excess, double order, int most);
// Of a stage most of whose bias is what slivers may hide that no sample met: more sub-samples, as many as are
// likely to find them. A finer mesh would find them, too, but each part of it costs an operator's row.
// Nothing if slivers are not what is missing, or so many points that more are no longer worth it have missed
// them.
std::optional<NextStep> more_sub_samples(const MeasuredScene& scene, const Stage& stage,
                                         const Estimate& estimate, double target);
// Of a stage that sees the surface in windows, most of the error is which part of it was seen: more runs,
// more windows, or the whole period where that is less work and fits. Nothing if that would not help.
std::optional<NextStep> more_windows(const MeasuredScene& scene, const Stage& stage, double excess,
                                     const std::function<bool(const RunSettings&)>& fits);
NextStep next_step(const RunContext& context, const Stage& stage, const Estimate& estimate, double target);

}  // namespace gonio
