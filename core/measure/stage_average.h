// What every transport does alike with its stages: average them, weigh their doubt, put one number to it.
#pragma once
#include "measure/estimate.h"

namespace gonio {

// Stages on the mesh of the last one are independent estimates of the same values: f and se of their mean,
// weighted by their pooled variances; bias is left 0.
Estimate average_stages(const MeasuredScene& scene, const std::vector<Stage>& stages);

// Share of each row's light that falls on, or is seen of, slivers which no sample met; 0 for windows and open
// surfaces, whose projected areas are not known.
std::vector<double> unresolved_rows(const MeasuredScene& scene, const Stage& stage);

// Fills total, random, systematic and direct from f, se and bias, and from the direct part of `last`, which
// tells of channel 0.
void summarise(const MeasuredScene& scene, const Stage& last, Estimate& estimate);

}  // namespace gonio
