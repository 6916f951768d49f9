// What random shifts cannot see: irradiance is taken as constant over each facet part. Two grids tell how
// much that matters.
#pragma once
#include "measure/run.h"

namespace gonio {

// Relative: true = computed * (1 + correction), with `uncertainty` left (one sigma). Of each pair (lights x
// views, or x lights if those are the views) where `pairs` is filled, else one for all of them.
struct MeshShare {
    double correction = 0, uncertainty = 0;  // of all pairs (rms)
    Matrix pairs;
    double typical = 0;  // rms of `pairs` over the table, weighted by value

    double correction_of(int light, int view) const {
        return pairs.values.empty() ? correction : pairs(light, view);
    }
    // lowest_cos: cosine of the more grazing of the two.
    double uncertainty_of(int light, int view, double lowest_cos) const;
};

// What two grids gave for the orders of scattering 2 and 3, or 2 to 5, at albedo 1; nothing, where the bias
// was only guessed.
struct MeshBias {
    std::vector<Matrix> exact, coarse;  // lights x views; or a few directions with themselves
    std::vector<size_t> asked;          // entries of those that stand for pairs of the table
    bool all_pairs = false;             // they are the table's lights and views
    double guess = 0;                   // uncertainty without two grids
    double guess_caution = 1.4;         // times the guess must be below the target, to do without two grids
    double ratio = 0;                   // of one order to the one before, at albedo 1

    bool measured() const { return !exact.empty(); }
    // Of the indirect part of the sum of orders 2 .. max_order (0: all) at an albedo.
    MeshShare share_of_sum(double albedo, int max_order) const;
    MeshShare share_of_order(int order) const;  // order >= 2
};

// Guess from how much neighbouring facets differ in tilt and from the slope, calibrated on two-grid runs of
// Gaussian fields: at slope 0.7 0.1 % (correlation length 8 cells) to 1.4 % (2 cells) of the indirect part.
// No run.
MeshBias predict_mesh_bias(const HeightField& surface);

// Whether the relief is such as the guess was calibrated on: not if it has few facets, or facets much taller
// than wide, which light crosses in bands.
bool mesh_bias_is_predictable(const RunContext& context);

// One run on parts twice as fine, and on the same rays with the irradiance averaged back to
// `settings.refinement` after every order: their difference falls with the square of the part's size, and so
// corrects the coarse result (Richardson). Pair by pair where the lights and views are few. falling: ratio of
// one order to the one before, albedo included; two orders do where they fall fast, four are measured else.
MeshBias measure_mesh_bias(const RunContext& context, const RunSettings& settings, double falling,
                           int n_threads, const Monitor& monitor);

}  // namespace gonio
