// What the runs did, in words and numbers, for the report and the table's provenance.
#pragma once
#include <string>

#include "measure/estimate.h"
#include "measure/report.h"

namespace gonio {

// Four significant digits.
std::string number(double x);

// What every transport says: adds to settings; and to skips, counters and warnings.
void describe_settings(const std::vector<Stage>& stages, Report& report);
void describe_skips(const MeasuredScene& scene, const Stage& last, const RunValues& totals, Report& report);
// Adds to settings how far frames turn on a curved base.
void describe_turn(const RunValues& totals, Report& report);

// Of the diffuse operator: adds to settings, fills counters, seconds; adds skips and warnings.
// report.relative_error is set already.
void describe_runs(const RunContext& context, const std::vector<Stage>& stages, const MeshBias& mesh_bias,
                   const RunValues& totals, Report& report);

}  // namespace gonio
