#pragma once
#include "fitting/ndf.h"
#include "fitting/slope_cells.h"

namespace gonio {

// Angle (radians, in (-45, 45] degrees) of the principal axis of the mean outer product that is nearest to
// +x.
double principal_rotation(const SlopeCell& moments);

// All four fits to cells of slopes, with the standard errors of n_effective facets.
std::vector<NdfFit> fit_slopes(const std::vector<SlopeCell>& cells, const EffectiveSize& n_effective);

}  // namespace gonio
