// Real spherical harmonics (SH), and hemispherical ones (HSH) for what lives above the horizon.
//
// Convention (that of tests/validation/data/sh_*.json): orthonormal over the sphere, **no** Condon-Shortley
// phase,
//   y_lm = sqrt2 K_l^|m| P_l^|m|(cos theta) * { cos(m phi), m > 0;  sin(|m| phi), m < 0 },   y_l0 = K_l^0
//   P_l(cos theta),
// so that y_11, y_1-1, y_10 are +sqrt(3 / 4 pi) times x, y, z. Coefficient (l, m) stands at l (l + 1) + m.
// "Order n" means the bands l = 0..n-1, n^2 coefficients, as in Nowrouzezahrai & Snyder 2009.
//
// Accuracy: orthonormal to 2e-14 up to order 32 (largest |<y_a, y_b> - delta_ab| by a quadrature that is
// exact for them; tests/unit/spherical_harmonics_test.cpp).
#pragma once
#include <span>
#include <vector>

#include "directions/direction.h"

namespace gonio {

inline constexpr int max_harmonic_order = 32;

inline constexpr int harmonic_count(int order) {
    return order * order;
}
inline constexpr int harmonic_index(int l, int m) {
    return l * (l + 1) + m;
}

// y_lm(w) of all bands below `order` (1 to max_harmonic_order) into y[0 .. order^2). w: a unit vector.
void sh_basis(int order, const Vec3& w, std::span<double> y);

// Hemispherical harmonics (Gautron et al. 2004): the associated Legendre functions shifted to [0, 1], P_l^m(2
// cos theta - 1), times sqrt2: orthonormal over the upper hemisphere. They need not model the jump at the
// horizon, which costs SH most of its terms. They are SH behind an area-preserving map of the hemisphere onto
// the sphere, and rotate about z only. w: unit, w.z >= 0.
void hsh_basis(int order, const Vec3& w, std::span<double> y);

// sum_lm c_lm y_lm(w); coefficients: order^2 of them.
double sh_value(int order, std::span<const double> coefficients, const Vec3& w);

// Zonal harmonics of a lobe round its axis: the factors Lambda_l by which the bands of anything convolved
// with it are multiplied. The lobe is (s + 1) / (2 pi) cos^s on the hemisphere around its axis, 0 beyond, of
// integral 1 (Phong; s = 1 and times pi: the clamped cosine of Ramamoorthi & Hanrahan 2001, eq. 19). exponent
// >= 0. [l] for l < order.
//   Lambda_l = (s + 1) int_0^1 z^s P_l(z) dz,   Lambda_l = Lambda_(l-2) (s - l + 2) / (s + l + 1).
std::vector<double> cosine_lobe_eigenvalues(int order, double exponent);

// SH coefficients of a lobe around `axis` (unit): c_lm = Lambda_l y_lm(axis), one Lambda a band.
std::vector<double> zonal_lobe(std::span<const double> eigenvalues, const Vec3& axis);

}  // namespace gonio
