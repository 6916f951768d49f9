// The loop of a measurement, whatever transports its light: stages of independent randomised runs, kept as
// shards, refined where the error comes from until the target is met, time is up or nothing helps.
#pragma once
#include "base/monitor.h"
#include "measure/brdf.h"
#include "measure/transport.h"

namespace gonio {

// Fills values, errors and orders of result.table, whose axes are set, and result.report. Throws Error(limit)
// if no run fits options.max_bytes, Error(cancelled).
void measure_by_runs(const MeasuredScene& scene, Transport& transport, const RunOptions& options,
                     const Monitor& monitor, BrdfResult& result);

}  // namespace gonio
