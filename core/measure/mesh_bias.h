// What random shifts cannot see: irradiance is taken as constant over each facet part. Two grids tell how
// much that matters.
#pragma once
#include "measure/run.h"

namespace gonio {

// Of the indirect part of f, relative. true = computed * (1 + correction), with `uncertainty` left (one sigma
// over the table's pairs and of the extrapolation).
struct MeshBias {
    double correction = 0, uncertainty = 0;
    bool measured = false;
};

// Guess from how much neighbouring facets differ in tilt, calibrated on two-grid runs of Gaussian fields: 0.1
// % (correlation length 8 cells) to 0.8 % (2 cells) of the indirect part. No run.
MeshBias predict_mesh_bias(const HeightField& surface);

// One run on parts twice as fine, and on the same rays with the irradiance averaged back to
// `settings.refinement`: their difference has no noise of its own, falls with the square of the part's size,
// and so corrects the coarse result (Richardson).
MeshBias measure_mesh_bias(const RunContext& context, const RunSettings& settings, int n_threads,
                           const Monitor& monitor);

}  // namespace gonio
