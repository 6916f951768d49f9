// Where a BRDF must be known to be projected to spherical harmonics.
#pragma once
#include <cstdint>
#include <vector>

#include "measure/plan.h"

namespace gonio {

// n directions over the upper hemisphere, uniform in solid angle and random: a Fibonacci lattice at a random
// place (seed, stream), so that each is where chance put it while all together leave no holes, which halves
// the condition number. cos theta >= 1e-3.
std::vector<AnglesDeg> scattered_directions(int n, uint64_t seed, uint64_t stream);

// The grid of quadrature for harmonics below `order`, theta slowest: 2 order x 4 order directions, exact for
// products of two harmonics and well beyond them, since a BRDF has more bands than its projection. Weights in
// sr, sum 2 pi.
struct ProjectionGrid {
    std::vector<AnglesDeg> directions;
    std::vector<double> solid_angle;
};
ProjectionGrid projection_grid(int order);
// Incident side of an isotropic joint projection: only the 2 order values of theta, at scattered azimuths.
ProjectionGrid isotropic_lights(int order);

// Sets incident, outgoing and pairs of a plan with `project` (incident is kept where the form is per_light).
// An isotropic joint projection measures `twins` pairs more: the first ones turned around z, which tell how
// isotropic the surface is.
void set_projection_directions(BrdfPlan& plan);
int isotropy_twins(const ProjectionPlan& plan);

}  // namespace gonio
