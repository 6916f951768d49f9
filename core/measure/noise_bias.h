// The second thing that random shifts cannot see: one run applies the same randomly sampled operator K more
// than once, and the mean of K^2 is not the square of the mean. E[K K] = Kbar Kbar + E[dK dK], always too
// much light: 0.6 % at slope 1.5 with 32 directions (shared/performance E).
#pragma once
#include "measure/run.h"

namespace gonio {

// dK dK acts nearly as kappa times the identity, so order k + 1 is too large by k - 1 times kappa c_{k-2},
// and the table, for albedo a, by about a^2 kappa (direct + 2 indirect). true = computed - that. Where the
// operator met every pair of directions of the table, the leading term is known per pair and only what
// follows it is guessed.
struct NoiseBias {
    double kappa = 0;      // albedo not included, unless facets carry it
    double doubt = 0;      // relative uncertainty of kappa for a pair
    Matrix pairs;          // (lights x lights): sum over the core of <dK g_l, dK g_v>, or empty
    double core_area = 0;  // of the tile of `pairs`
};

// From K g of several independent runs over the same tile, `first` of each (the same columns): the cross
// products of different runs have no such bias, so the mean of <K g, K g> minus that of <K g, K' g> is it.
// irradiance: g of the first block of those columns (any one run's).
NoiseBias noise_bias(const Tile& tile, const std::vector<const Fields*>& first, const Fields& irradiance,
                     bool keep_pairs, int n_threads);

// Two operators over one window of a large surface, for a few directions.
NoiseBias measure_noise_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                             const Monitor& monitor);

}  // namespace gonio
