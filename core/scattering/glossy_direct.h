// The direct term of flat facets: their lobes are exact, only what is visible inside a facet is sampled.
#pragma once
#include "base/monitor.h"
#include "scattering/fields.h"
#include "scattering/lobe_kernels.h"
#include "scattering/visibility_bits.h"

namespace gonio {

// sums (lights x views) += share * sum over the core of area f(n; l, v) <n,l>+ <n,v>+ popcount(V_l & V_v),
// shadowing and masking of a facet together, not each on average. `same`: views are the lights; only half is
// computed. The same bits for any number of threads.
void add_direct(const SlotMaterial& material, const Tile& tile, const DirectionArrays& lights,
                const DirectionArrays& views, bool same, const VisibilityBits& light_bits,
                const VisibilityBits& view_bits, double share, int n_threads, const Monitor& monitor,
                Matrix& sums);

}  // namespace gonio
