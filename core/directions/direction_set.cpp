#include "directions/direction_set.h"

#include <algorithm>

namespace gonio {

DirectionSet slab_directions(int n, double z_max, double shift_z, double shift_phi) {
    constexpr double golden = 0.6180339887498949;
    DirectionSet set;
    set.directions.reserve(n);
    set.solid_angle.assign(n, 4 * pi * z_max / n);
    for (int i = 0; i < n; ++i) {
        double z = z_max * (2 * fractional_part((i + shift_z) / n) - 1);
        if (std::abs(z) < 1e-4) z = z < 0 ? -1e-4 : 1e-4;
        const double radius = safe_sqrt(1 - z * z), phi = 2 * pi * fractional_part(shift_phi + i * golden);
        set.directions.push_back({radius * std::cos(phi), radius * std::sin(phi), z});
    }
    return set;
}

}  // namespace gonio
