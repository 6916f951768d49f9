// Synthetic reliefs with closed-form answers, sampled at cell corners x_i = i * pitch (tests/validation states each formula).
#pragma once
#include <cstdint>

#include "surface/height_field.h"

namespace gonio {

// All lengths in metres. samples = nodes along x; samples_y = nodes along y (1: invariant). Errors: Error with the member's name.
HeightField generate_plane(int samples, double pitch);
// h = tan(slope) |x - P round(x / P)|: ridge at P/2, valley at 0. samples even, so that both lie on nodes.
HeightField generate_v_groove(int samples, double period, double slope_deg);
// h = -depth for x in (0, groove_width), 0 on the rest of the period; cell-centred sampling x_i = (i + 1/2) period / samples.
HeightField generate_rectangular_groove(int samples, double period, double groove_width, double depth);
// h = amplitude sin(2 pi x / period)
HeightField generate_sinusoid(int samples, double period, double amplitude);
// h = amplitude (cos(2 pi x / period) + cos(2 pi y / period)), samples x samples
HeightField generate_egg_crate(int samples, double period, double amplitude);
// One spherical pit a square cell of side `period`: h = R cos(eta) - sqrt(R^2 - r^2) for r < R sin(eta), else 0, centred.
HeightField generate_spherical_pits(int samples, double period, double radius, double eta_deg);
// Periodic Gaussian random field, autocorrelation exp(-r^2 / l^2), rescaled so that the rms of |grad h| over the facets is rms_slope
// exactly. correlation_length in metres.
HeightField generate_gaussian(int samples_x, int samples_y, double pitch, double correlation_length, double rms_slope,
                              uint64_t seed);

}  // namespace gonio
