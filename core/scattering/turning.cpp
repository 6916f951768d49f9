#include "scattering/turning.h"

#include <cmath>

#include "visibility/crossings.h"
#include "visibility/curvature.h"

namespace gonio {

Vec3 Turning::turned(const Vec3& direction, double travel) const {
    return turned_direction(direction, rate * travel, towards[0], towards[1]);
}

Turning turning_along(const MarchGrid& grid, const Vec3& direction) {
    Turning turning;
    const MarchDirection step = to_march_direction(grid, direction);
    const double x = step.step_x * grid.pitch_x, y = step.step_y * grid.pitch_y;
    const BaseCurvature::Tensor k = grid.base.tensor();
    const double turn_x = k.xx * x + k.xy * y, turn_y = k.xy * x + k.yy * y;
    const double c = std::cos(grid.base.direction), s = std::sin(grid.base.direction);
    turning.rate = std::hypot(turn_x, turn_y);
    if (turning.rate > 0) {
        turning.towards[0] = turn_x / turning.rate;
        turning.towards[1] = turn_y / turning.rate;
    }
    turning.about[0] = c * turn_x + s * turn_y;
    turning.about[1] = c * turn_y - s * turn_x;
    return turning;
}

}  // namespace gonio
