// What the runs did, in words and numbers, for the report and the table's provenance.
#pragma once
#include <string>

#include "measure/estimate.h"
#include "measure/report.h"

namespace gonio {

// Four significant digits.
std::string number(double x);

// Fills settings, counters, seconds; adds skips and warnings. report.relative_error is set already.
void describe_runs(const RunContext& context, const std::vector<Stage>& stages, const MeshBias& mesh_bias,
                   const RunValues& totals, Report& report);

}  // namespace gonio
