// How many sub-samples, directions, windows and runs: a first guess from the relief, then whatever dominates
// the error.
#pragma once
#include "measure/estimate.h"

namespace gonio {

inline constexpr int runs_at_first = 6, most_runs = 16, most_window_runs = 32;

RunSettings first_settings(const RunContext& context, double target);

// Windows that cover the surface once, along x and y.
std::pair<int, int> covering_windows(const RunContext& context);
// Whether one run at these settings fits context.max_bytes.
bool run_fits(const RunContext& context, const RunSettings& settings);
// Work of a run relative to another's.
double relative_cost(const RunContext& context, const RunSettings& settings, const RunSettings& reference);

struct NextStep {
    bool possible = false;  // false: nothing that could be changed would help
    int more_runs = 0;      // > 0: at the same settings; 0: a new stage at `settings`
    RunSettings settings;
};
NextStep next_step(const RunContext& context, const Stage& stage, const Estimate& estimate, double target);

}  // namespace gonio
