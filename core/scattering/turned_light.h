// Light on a curved base. A light fixed in the world is another one for every point: seen from a neighbour
// whose frame has turned by t (two angles, towards the principal directions of the base), it stands at
// turned_direction(light, t). So the irradiance of each facet is needed for all turns that its neighbours ask
// for, and is kept as a polynomial of second degree in t, which bounces carry on exactly: shifting t by the
// turn along a link maps such polynomials to each other. What it leaves out is of third order in (turn along
// a path) / (angle over which a facet's irradiance changes).
#pragma once
#include <vector>

#include "scattering/link_operator.h"

namespace gonio {

// Coefficients of lights x unknowns: 1, t, t^2 where the base is curved along one principal direction only,
// else 1, t0, t1, t0^2, t0 t1, t1^2.
struct TurnedLight {
    std::vector<Fields> coefficients;
    double rays = 0;  // that were marched for the turned lights
    int axis = 0;     // which principal direction t turns towards, if there is one
};

// rms of the turns along the links, weighted as light is; radians.
double rms_turn(const LinkOperator& op);
// How far lights are best turned for the polynomial, from the rms of the turns: 1.5 times that; most turns lie
// within.
double turn_step(double rms_turn);
// Coefficients that a light takes on a base: 1 on a flat one.
int turned_coefficients(const BaseCurvature& base);

// The polynomial through lights turned by 0 and +-step, and by both steps together. `straight`:
// light_irradiance of the lights themselves, at the same places.
TurnedLight turned_light(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                         Fields straight, double step, const std::vector<SubSample>& sub_samples,
                         bool skip_steep, int n_threads, const Monitor& monitor);

// K x, with the light turned along every link.
TurnedLight apply(const LinkOperator& op, const TurnedLight& x, int n_threads);

}  // namespace gonio
