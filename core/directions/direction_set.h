// Directions that all points of a surface share: the method of dependent tests (Heidrich et al. 2000,
// sec. 3.1).
#pragma once
#include <vector>

#include "directions/direction.h"

namespace gonio {

struct DirectionSet {
    std::vector<Vec3> directions;
    std::vector<double> solid_angle;  // each direction's quadrature weight, sr
};

// n directions uniform over the slab |z| <= z_max, z stratified, azimuth by the golden ratio: a rank-1
// lattice whose error falls nearly as n^-2 for the smooth macro averages it serves (shared/performance E).
// shift_z, shift_phi in [0, 1) randomise it (Cranley-Patterson). Every |z| is at least 1e-4: a horizontal ray
// in a periodic relief need not end. It is tempting to put more directions where rays hit (small |z|): with
// weights that jump between bins the lattice loses its order, and the error grew 2.5 times at equal n.
DirectionSet slab_directions(int n, double z_max, double shift_z, double shift_phi);

}  // namespace gonio
