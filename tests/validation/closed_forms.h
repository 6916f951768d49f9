// Answers that need no table.
#pragma once
#include <algorithm>
#include <cmath>

#include "directions/direction.h"

namespace gonio::reference {

// Direct term of the V-groove h = tan(alpha) |x|, invariant along y: each wall is lit, and seen, from its
// ridge down to a fraction m = min(1, 2 / (1 + slope t)), t = tan(theta) |cos(phi)|: where it faces the
// direction and the opposite wall shades it.
inline double v_groove_direct(double slope, double albedo, const AnglesDeg& wi_deg, const AnglesDeg& wo_deg) {
    const Vec3 wi = to_vector(wi_deg), wo = to_vector(wo_deg);
    const auto seen_part = [&](const Vec3& w) {
        const double t = std::abs(w.x) / w.z;
        return slope * t <= 1 ? 1 : 2 / (1 + slope * t);
    };
    const double m = std::min(seen_part(wi), seen_part(wo)), c = 1 / std::hypot(1.0, slope);
    double f = 0;
    for (const double side : {-1.0, 1.0}) {
        const Vec3 n{side * slope * c, 0, c};
        f += std::max(0.0, dot(n, wi)) * std::max(0.0, dot(n, wo)) / c * m / 2;
    }
    return albedo / pi * f / (wi.z * wo.z);
}

}  // namespace gonio::reference
