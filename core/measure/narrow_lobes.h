// Lobes narrower than the shared directions are dense: which they are, what they carry beyond the first
// order, and what of that so many samples may have missed.
//
// The scatter of samples tells their error only where samples meet lobes. Of lobes of alpha 1e-4 none does:
// all runs agree that there is nothing. But how much light leaves after two reflections and more is cheaply
// known, from a few rays that follow lobes; what is not known is towards which views. So stated errors are at
// least what a count of rare events leaves: if a view meets n chains of samples on average, each brings 1 / n
// of the mean over the views, and x n of them did, then with the mean for a prior (Gamma of shape 1, to
// Poisson's law) it is known within mean sqrt(n x + 1) / (n + 1): the mean itself where nothing can be met,
// mean sqrt(x / n) where much is. An expectation over views and reliefs, no bound: single values of narrow
// lobes can be many times their mean.
#pragma once
#include <vector>

#include "base/monitor.h"
#include "material/material.h"
#include "scattering/tile.h"
#include "surface/height_field.h"
#include "visibility/march_grid.h"

namespace gonio {

struct NarrowLobes {
    double share = 0;           // of all reflected light, in such lobes; 0: there are none
    double solid_angle = 4;     // of the narrowest, sr: what it reflects over its peak
    double chance_of_pair = 1;  // that a pair leaves a facet inside that
    explicit operator bool() const { return share > 0; }
};
// Those that reach over less than `solid_angle`.
NarrowLobes narrower_lobes(const Material& material, double solid_angle);
// At so many shared directions: those that send a pair more than narrow_share_of_pair (graph_run.h).
NarrowLobes narrow_lobes(const Material& material, const MarchGrid& grid, const Tile& tile, int n_directions);

// What leaves the surface after k + 2 reflections, of the flux that a light brings: [light][channel][k].
using LaterLight = std::vector<std::vector<std::vector<double>>>;
// By forward tracing of some 2^19 rays, or a block of 32 x 32 cells a light; on a curved base of the relief
// without it. max_order: 0: all.
LaterLight trace_later_light(const HeightField& surface, const Material& material,
                             const std::vector<Vec3>& lights, int max_order, uint64_t seed, int n_threads,
                             const Monitor& monitor);

// How many chains of samples of order k + 2 meet a view on average: [k], for one light and `later` orders of
// one channel. Of so many pairs, which start at so many facets; and of so many rays of sample_orders.
std::vector<double> chains_of_pairs(const NarrowLobes& lobes, const std::vector<double>& later, double pairs,
                                    double facets);
std::vector<double> chains_of_rays(const NarrowLobes& lobes, const std::vector<double>& later, double rays);

// The error of f, in 1/sr, that so few chains leave at least: of one order >= 2, or of all of them (0), of
// which `found` was found.
double undersampled(const NarrowLobes& lobes, const std::vector<double>& later,
                    const std::vector<double>& chains, int order, double found);

}  // namespace gonio
