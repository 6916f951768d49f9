// Fresnel's equations for unpolarised light, exact. cos_theta: between the direction and the normal of the
// interface, in [0, 1].
#pragma once
#include "base/numeric.h"

namespace gonio {

// Onto a dielectric of index eta (relative to where the light comes from). 1 beyond the critical angle.
inline double fresnel_dielectric(double cos_theta, double eta) {
    const double squared = (eta * eta - 1) + cos_theta * cos_theta;  // (eta cos_inside)^2
    if (squared <= 0) return eta == 1 ? 0 : 1;
    const double cos_inside = std::sqrt(squared) / eta;
    const double s = (cos_theta - eta * cos_inside) / (cos_theta + eta * cos_inside),
                 p = (eta * cos_theta - cos_inside) / (eta * cos_theta + cos_inside);
    return (s * s + p * p) / 2;
}

// Onto a metal of index eta + i k: Born & Wolf, Principles of Optics, 14.2, with u + i v = sqrt((eta + i k)^2
// - sin^2).
inline double fresnel_conductor(double cos_theta, double eta, double k) {
    if (cos_theta <= 0) return eta == 1 && k == 0 ? 0 : 1;
    const double cos_2 = cos_theta * cos_theta, sin_2 = 1 - cos_2;
    const double real = (eta * eta - 1) - k * k + cos_2, imaginary = 2 * eta * k,
                 length = std::hypot(real, imaginary);
    // length = u^2 + v^2; of the two forms of u the one that does not cancel.
    const double u = real > 0 ? std::sqrt((length + real) / 2) : imaginary / std::sqrt(2 * (length - real));
    const double s = (length + cos_2 - 2 * cos_theta * u) / (length + cos_2 + 2 * cos_theta * u);
    const double a = cos_2 * length + sin_2 * sin_2, b = 2 * cos_theta * u * sin_2;
    return s * (1 + (a - b) / (a + b)) / 2;
}

}  // namespace gonio
