// The sets of directions that a job can ask for (design 4: directions/gonio_grid).
#pragma once
#include <vector>

#include "directions/direction.h"

namespace gonio {

// Every theta with every phi, theta slowest.
std::vector<AnglesDeg> product_grid(const std::vector<double>& theta_deg, const std::vector<double>& phi_deg);

// n directions over the upper hemisphere, each standing for the same projected solid angle pi / n: a
// Fibonacci lattice on the unit disk lifted to the hemisphere (sin^2 theta = (k + 1/2) / n). n >= 1.
std::vector<AnglesDeg> equal_projected_hemisphere(int n);

// Centres of the 145 patches of the Klems full basis: rings with theta bounds 0-5-15-...-75-90 deg and 1, 8,
// 16, 20, 24, 24, 24, 16, 12 azimuths; patch k of a ring is centred at azimuth 360 k / n (shared/formats 2.3;
// Klems 1994). Directions point away from the surface, phi = azimuth for light and view alike (the
// incident-azimuth turn of the XML files is the writer's).
std::vector<AnglesDeg> klems_full();

// The 81 directions of the BTF data bases of Bonn (2003) and of UTIA: theta 0, 15, ..., 75 degrees with 1, 6, 12, 18, 20, 24 azimuths
// from 0 (Sattler, Sarlette and Klein 2003, table 1; shared/formats 2.10).
std::vector<AnglesDeg> bonn_81();

// 151 directions spread like the cameras of the Bonn dome (UBO2014): a pole and rings every 7.5 degrees to 75, whose azimuths alternate
// by half a step: the rings of bonn_81 and 6, 10, 14, 18, 22 between them. The dome's own azimuths are calibrated and differ from file
// to file: to match one, list its directions.
std::vector<AnglesDeg> bonn_151();

}  // namespace gonio
