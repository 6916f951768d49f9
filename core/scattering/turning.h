// How the frame of a curved base turns along a ray.
#pragma once
#include "directions/direction.h"
#include "scattering/kernels.h"
#include "visibility/march_grid.h"

namespace gonio {

struct Turning {
    double rate = 0;         // radians per cell of travel,
    double towards[2] = {};  // towards this horizontal direction
    double about[2] = {};    // and its parts along the principal directions of the base

    // A direction that is fixed in the world, told at the end of the way.
    Vec3 turned(const Vec3& direction, double travel) const;
    LinkTurn turn(double travel) const {
        return {{static_cast<float>(travel * about[0]), static_cast<float>(travel * about[1])}};
    }
};
Turning turning_along(const MarchGrid& grid, const Vec3& direction);

}  // namespace gonio
