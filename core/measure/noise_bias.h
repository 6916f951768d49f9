// The second thing that random shifts cannot see: one run applies the same randomly sampled operator K more
// than once, and the mean of K^2 is not the square of the mean. E[K K] = Kbar Kbar + E[dK dK], always too
// much light: 0.6 % at slope 1.5 with 32 directions (shared/performance E).
#pragma once
#include "measure/run.h"

namespace gonio {

// dK dK acts nearly as kappa times the identity, so order k is too large by (k - 1) kappa c_{k-2}, and the
// table by about kappa (direct + 2 indirect), albedo^2 included in kappa. true = computed - kappa (direct + 2
// indirect).
struct NoiseBias {
    double kappa = 0, uncertainty = 0;
};

// From K g of several independent runs over the same tile, `first` of each (one block of the same columns):
// the cross products of different runs have no such bias, so the mean of <K g, K g> minus that of <K g, K' g>
// is it. irradiance: g of the same columns (any one run's).
NoiseBias noise_bias(const Tile& tile, const std::vector<const Fields*>& first, const Fields& irradiance,
                     double largest_albedo);

// Two operators over one window of a large surface.
NoiseBias measure_noise_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                             const Monitor& monitor);

}  // namespace gonio
