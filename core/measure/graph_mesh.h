// What random shifts cannot see of the pair graph: the radiance that scatters is taken as constant over each
// facet part. Two grids tell how much that matters.
#pragma once
#include "measure/graph_run.h"

namespace gonio {

// Relative error (rms over pairs of up to 16 directions of the table) of the second order at these settings:
// parts twice as fine, and the same pairs with the visible cosines averaged back; what is found in two
// independent samplings alike. Richardson: the difference falls with the square of the part's size.
double measure_graph_mesh(const GraphContext& context, const RunSettings& settings, int n_threads,
                          const Monitor& monitor);

}  // namespace gonio
