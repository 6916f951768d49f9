// The judge: the same job by the Embree path tracer. Shares with the fast engine only the relief, the plan
// and the table.
#pragma once
#include "measure/brdf.h"

namespace gonio {

struct ReferenceOptions {
    long long paths = 4096;  // paths from each outgoing direction; each is shared by all incident ones.
                             // Rounded up to twice a square.
};

// plan.accuracy.seed seeds it; the rest of plan.accuracy is not used.
BrdfResult measure_reference(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                             const ReferenceOptions& reference, const RunOptions& options,
                             const Monitor& monitor = {});

}  // namespace gonio
