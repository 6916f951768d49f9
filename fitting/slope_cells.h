// The slopes of millions of facets, gathered into some ten thousand cells that a maximum-likelihood fit can
// afford.
#pragma once
#include <array>
#include <functional>
#include <vector>

#include "surface/facet_mesh.h"

namespace gonio {

// Facets of nearly equal slope (up to sign): how many, and the mean of (p^2, p q, q^2). The log-likelihoods
// depend on the slopes through quadratic forms alone, and these are linear in the means: Beckmann loses
// nothing, GGX only what the logarithm bends within a cell, which moves a fitted alpha by less than 1e-4 of
// itself (tested).
struct SlopeCell {
    double count = 0, xx = 0, xy = 0, yy = 0;
};

struct SlopeSums {
    long long n = 0, n_level = 0;                                          // facets; facets without any slope
    double mean_x = 0, mean_y = 0, xx = 0, xy = 0, yy = 0, max_slope = 0;  // means, and the steepest |grad h|
    // Facets by size of slope: bin of the leading bits of p^2 + q^2, eight a factor of two.
    std::vector<long long> by_size;
};

// Calls visit(const Gradient&) for every facet inside the measured border, rows in order.
template <class Visit>
void for_each_facet(const HeightField& s, Visit&& visit) {
    for (int j = s.border_y; j < s.ny - s.border_y; ++j) {
        const float* row = &s.heights[static_cast<size_t>(j) * s.nx];
        const float* next = &s.heights[static_cast<size_t>(j + 1 < s.ny ? j + 1 : 0) * s.nx];
        for (int i = s.border_x; i < s.nx - s.border_x; ++i) {
            const int i1 = i + 1 < s.nx ? i + 1 : 0;
            const double h00 = row[i], h10 = row[i1], h01 = next[i], h11 = next[i1];
            visit(Gradient{(h10 - h00) / s.pitch_x, (h11 - h10) / s.pitch_y});
            visit(Gradient{(h11 - h01) / s.pitch_x, (h01 - h00) / s.pitch_y});
        }
    }
}

SlopeSums sum_slopes(const HeightField& surface);

// Slope below which (to 5 %) the share u of the facets lies; level facets are left out if `without_level`.
double slope_quantile(const SlopeSums& sums, double u, bool without_level);

std::vector<SlopeCell> gather_cells(const HeightField& surface, const SlopeSums& sums);

}  // namespace gonio
