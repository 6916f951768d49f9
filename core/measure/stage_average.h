// What every transport does alike with its stages: average them, weigh their doubt, put one number to it.
#pragma once
#include "measure/estimate.h"

namespace gonio {

// Stages on the mesh of the last one are independent estimates of the same values: f, se and hidden of their
// mean, weighted by what each leaves in doubt; bias is left 0.
Estimate average_stages(const MeasuredScene& scene, const std::vector<Stage>& stages);

// Bound on what each row of a slice ([channel][slice], counted through) misses of the light that falls on, or
// is seen of, slivers which no sample met; 0 for windows and open surfaces, whose projected areas are not
// known.
std::vector<double> hidden_light(const MeasuredScene& scene, const Stage& stage, size_t slice);

// The weight of a stage is one over this: se and hidden of a slice, relative, squared and summed over its
// rows.
double pooled_doubt(const Stage& stage, size_t slice, const std::vector<double>& se,
                    const std::vector<double>& hidden);

// Fills what is relative from f, se, bias and hidden, and from the direct part of `last`: of `channel`, to be
// multiplied by unit_direct.
void summarise(const MeasuredScene& scene, const Stage& last, size_t channel, double unit_direct,
               Estimate& estimate);

}  // namespace gonio
