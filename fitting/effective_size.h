#pragma once
#include "fitting/ndf.h"

namespace gonio {

// n_eff of each parameter of a Beckmann fit whose axes stand at `rotation` (radians), from the measured
// correlation of the slopes. Between 1 and the number of cells (the two facets of a cell share their edges).
// Strictly periodic relief, whose spectrum is lines and no continuum, is credited with up to ten times too
// many: there the patch is the population and a standard error has no meaning.
EffectiveSize effective_size(const HeightField& surface, double rotation);

}  // namespace gonio
