// Directions as a triangulated sphere, and the solid angle that each stands for: a third of the triangle fan
// around it (Heidrich et al. 2000, sec. 5, fig. 8). When directions move, the change of their fans is the
// change of their importance.
#pragma once
#include <array>
#include <vector>

#include "directions/direction.h"

namespace gonio {

struct DirectionMesh {
    std::vector<std::array<int, 3>> triangles;  // counter-clockwise as seen from outside
};

// Delaunay triangulation: the convex hull of at least 4 unit vectors, all around the sphere, no two alike.
DirectionMesh triangulate(const std::vector<Vec3>& directions);

// Solid angle of a spherical triangle, below 0 if it is clockwise (van Oosterom & Strackee 1983).
double solid_angle(const Vec3& a, const Vec3& b, const Vec3& c);

// A third of the fan of each direction; all of them make 4 pi, whether the directions are where they were
// triangulated or have moved, as long as the mesh does not fold.
void fan_solid_angles(const DirectionMesh& mesh, const std::vector<Vec3>& directions,
                      std::vector<double>& fans);

}  // namespace gonio
