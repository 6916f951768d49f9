// What a bent base leaves in doubt. Rays bend exactly from edge to edge, but facets are flat between nodes
// that stand on a curved base: edges are off by the sagitta kappa pitch^2 / 8, shadows of a light at theta by
// tan theta times that, on a relief whose slopes change over its correlation length T; and light that is
// dimmed so is told over cos theta.
#pragma once
#include "measure/estimate.h"
#include "measure/scene.h"

namespace gonio {

// 0.15 |kappa| pitch^2 / (8 T) tan^2 theta, at most 1, of the larger curvature and pitch: the relative error
// of the direct term, rms over azimuths, as measured (README). 0 on a flat base.
double base_doubt(const HeightField& surface, const Vec3& direction);

// That of light and view together, rms over the rows.
double base_doubt(const MeasuredScene& scene);
// Into the biases, for light and view of each row, and the totals of an estimate.
void add_base_doubt(const MeasuredScene& scene, Estimate& estimate);

}  // namespace gonio
