// The main job: the BRDF of a relief with shadowing, masking and all orders of scattering, each value with
// its doubt.
#pragma once
#include "base/monitor.h"
#include "material/material.h"
#include "measure/plan.h"
#include "measure/report.h"
#include "surface/height_field.h"
#include "table/table.h"

namespace gonio {

struct BrdfResult {
    Table table;
    Report report;
};

// Throws Error for what validate() would refuse, Error(limit) if the job cannot fit options.max_bytes,
// Error(cancelled).
BrdfResult measure_brdf(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                        const RunOptions& options, const Monitor& monitor = {});

}  // namespace gonio
