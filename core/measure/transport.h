// The one seam of light transport: a measurement asks it for independent randomised runs, refines what
// dominates their error, and knows nothing of how light travels. One class a transport; the list is in
// transport_choice.cpp.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/estimate.h"
#include "measure/forecast.h"
#include "measure/planning.h"
#include "measure/report.h"
#include "measure/run.h"
#include "measure/scene.h"

namespace gonio {

// Side measurements that every process may make for itself, but need not make twice: bytes of `compute` kept
// under a name that the stage's settings and `part` decide (Shards::part).
struct SideWork {
    std::function<std::string(const Stage& stage, const std::string& part,
                              const std::function<std::string()>& compute)>
        kept;
    int n_threads = 1;
    const Monitor& monitor;
};

class Transport {
  public:
    virtual ~Transport() = default;

    // What to begin with for a relative error, and for explicit samples (throws Error for what it cannot do).
    virtual RunSettings first_settings(double target) const = 0;
    virtual RunSettings settings_of(const Accuracy::Samples& samples) const = 0;
    // Working memory, bytes: of a run cut as small as it can be, and of one as it would like to be.
    virtual double least_bytes(const RunSettings& settings) const = 0;
    virtual double wanted_bytes(const RunSettings& settings) const = 0;

    // One complete, unbiased table from random numbers keyed by (seed, stage, run): the same bits on any
    // number of threads. Called from several threads at once.
    virtual RunValues run(const RunSettings& settings, int stage, int run, int n_threads,
                          const Monitor& monitor) const = 0;
    // What decides the bits of a run beside the job, the stage and the number of the run, and of that what a
    // job with another target may have in common with this one; 16 hex digits.
    virtual std::string settings_key(const RunSettings& settings) const = 0;

    // Single orders are wanted, of no fixed number: every later run keeps as many as this first one.
    virtual void fix_orders(const RunValues& first) = 0;
    // Before and after `n_runs` runs of a stage; after, `runs` are not yet part of it.
    virtual void begin_stage(const Stage& /*stage*/, int /*n_runs*/) {}
    virtual void end_stage(Stage& /*stage*/, const std::vector<RunValues>& /*runs*/,
                           const SideWork& /*side*/) {}
    // After the first stage, and after each whose refinement is new: what no random shift can see.
    virtual void find_bias(const std::vector<Stage>& /*stages*/, const SideWork& /*side*/,
                           Report& /*report*/) {}

    virtual Estimate estimate(const std::vector<Stage>& stages) const = 0;
    virtual NextStep next_step(const Stage& stage, const Estimate& estimate, double target) const = 0;
    virtual RunForecast forecast(const RunSettings& settings) const = 0;
    // Work of a run relative to another's.
    virtual double relative_cost(const RunSettings& settings, const RunSettings& reference) const = 0;

    // Fills report.settings, counters and seconds; adds skips and warnings. report.relative_error is set.
    virtual void describe(const std::vector<Stage>& stages, const RunValues& totals,
                          Report& report) const = 0;
};

}  // namespace gonio
