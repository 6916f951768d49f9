// Directions. Right-handed frame, z up out of the surface, x along columns, y along rows; unit vectors
// pointing away from the surface; theta from +z, phi = atan2(y, x). Radians inside, degrees at the rim (spelt
// _deg).
#pragma once
#include <cmath>
#include <vector>

#include "base/numeric.h"

namespace gonio {

struct Vec3 {
    double x = 0, y = 0, z = 0;
};
inline double dot(const Vec3& a, const Vec3& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// A direction as the user wrote it: kept in degrees so that tables repeat the very numbers of the job.
struct AnglesDeg {
    double theta_deg = 0, phi_deg = 0;
    bool operator==(const AnglesDeg&) const = default;
};

inline Vec3 to_vector(const AnglesDeg& a) {
    const double theta = radians(a.theta_deg), phi = radians(a.phi_deg);
    // Multiples of 90 degrees exactly, so that axis-aligned directions are axis-aligned.
    auto exact = [](double c) { return std::abs(c) < 1e-15 ? 0.0 : c; };
    return {exact(std::sin(theta) * std::cos(phi)), exact(std::sin(theta) * std::sin(phi)),
            exact(std::cos(theta))};
}

}  // namespace gonio
