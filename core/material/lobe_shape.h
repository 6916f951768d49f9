// How wide a material's lobes are and what each reflects: by that the work of a transport is foreseen, and
// what its directions are too few for.
#pragma once
#include <vector>

#include "material/material.h"

namespace gonio {

struct LobeShape {
    double share = 0;  // of the light at normal incidence, mean over channels and over maps
    // Alpha of the GGX lobe that is as high: what is sent straight back into the normal is
    // share / (4 pi width^2). 0.5 for Lambertian facets, 0 for mirrors; the narrowest of a map.
    double width = 0;
};

// One a lobe, or two for a coat (its reflection and its base).
std::vector<LobeShape> lobe_shapes(const Material& material);

// All of their shares together.
double reflected_share(const Material& material);

// Largest f cos of light along the normal, in 1/sr; infinite for a mirror that reflects at all.
double highest_peak(const Material& material);

}  // namespace gonio
