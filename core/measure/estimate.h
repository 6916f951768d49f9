// From stages of independent runs to the values, standard errors and biases of a table.
#pragma once
#include <optional>

#include "measure/accuracy.h"
#include "measure/mesh_bias.h"
#include "measure/noise_bias.h"
#include "measure/run.h"

namespace gonio {

// How far the sampled projected area of a direction is from the true one, where that is more than noise (5
// %); else 0. So much of what is seen from there lies in slivers that no sample met.
double unresolved_share(double projected_ratio);

// Independent runs at the same settings.
struct Stage {
    RunSettings settings;
    int number = 0;
    Moments f, direct, projected_lights, projected_views;  // of the members of RunValues
    double remainder = 0, ratio = 0;                       // of the orders (diffuse.h), largest of its runs
    std::optional<NoiseBias> noise;  // found once a stage, or taken over from one that samples K alike
};

struct Estimate {
    std::vector<double> f, se, bias;  // [channel][slice][row], as in Table
    std::vector<double> hidden;       // the part of bias that slivers no sample met may hide
    // Relative to max(f, 0.01 mean f), rms over rows and channels: standard error and bias together, each
    // alone, and the standard error of the direct part of channel 0.
    double total = 0, random = 0, systematic = 0, direct = 0;
    double rare = 0;  // part of `systematic`: what too few samples meet; more of them take it away
    double unresolved = 0;  // what systematic would fall by if nothing were hidden
};

// Stages on the mesh of the last one are independent estimates of the same values: they are averaged,
// weighted by their pooled variances. skipped_bound: relative bound on indirect light that was not computed.
Estimate make_estimate(const RunContext& context, const RowGroups& groups, const std::vector<Stage>& stages,
                       const MeshBias& mesh_bias, double skipped_bound);

}  // namespace gonio
