// Quadrature over intervals and over the upper hemisphere.
#pragma once
#include <vector>

#include "directions/direction_set.h"

namespace gonio {

struct Quadrature {
    std::vector<double> nodes, weights;  // nodes increase
};

// Gauss-Legendre rule of n >= 1 nodes on [low, high]: exact for polynomials up to degree 2 n - 1. Nodes and
// weights to 1e-14 up to n = 512.
Quadrature gauss_legendre(int n, double low, double high);

// Gauss-Legendre in cos theta (n_z nodes on (0, 1)) times n_phi even azimuths (the first at half a step),
// theta slowest; weights in sr, sum 2 pi. Exact for polynomials in x, y, z of degree below min(2 n_z, n_phi),
// which on the hemisphere SH products are.
DirectionSet hemisphere_quadrature(int n_z, int n_phi);

}  // namespace gonio
