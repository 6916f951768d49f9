// Triangulated directions, and what the fans around them become when a base bends.
#include "visibility/direction_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>

#include "directions/direction_set.h"
#include "visibility/curvature.h"

namespace gonio {
namespace {

std::vector<Vec3> sphere(int n) {
    return slab_directions(n, 1, 0.4, 0.1).directions;
}

TEST(DirectionMesh, IsDelaunayAndClosed) {
    const std::vector<Vec3> p = sphere(150);
    const DirectionMesh mesh = triangulate(p);
    EXPECT_EQ(mesh.triangles.size(), 2 * p.size() - 4);  // Euler
    std::map<std::pair<int, int>, int> edges;
    for (const auto& t : mesh.triangles) {
        for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
        EXPECT_GT(solid_angle(p[t[0]], p[t[1]], p[t[2]]), 0);
        // No direction lies inside the circle through the corners.
        const Vec3 &a = p[t[0]], &b = p[t[1]], &c = p[t[2]];
        const Vec3 ab{b.x - a.x, b.y - a.y, b.z - a.z}, ac{c.x - a.x, c.y - a.y, c.z - a.z};
        const Vec3 n{ab.y * ac.z - ab.z * ac.y, ab.z * ac.x - ab.x * ac.z, ab.x * ac.y - ab.y * ac.x};
        for (const Vec3& q : p) EXPECT_LT(dot(n, q), dot(n, a) + 1e-12);
    }
    for (const auto& [edge, times] : edges) {
        EXPECT_EQ(times, 1);
        EXPECT_TRUE(edges.contains({edge.second, edge.first}));
    }
}

TEST(DirectionMesh, SolidAnglesAreThoseOfSphericalTriangles) {
    EXPECT_NEAR(solid_angle({1, 0, 0}, {0, 1, 0}, {0, 0, 1}), pi / 2, 1e-14);
    EXPECT_NEAR(solid_angle({0, 1, 0}, {1, 0, 0}, {0, 0, 1}), -pi / 2, 1e-14);
    const std::vector<Vec3> p = sphere(400);
    std::vector<double> fans;
    fan_solid_angles(triangulate(p), p, fans);
    EXPECT_NEAR(std::accumulate(fans.begin(), fans.end(), 0.0), 4 * pi, 1e-10);
    for (size_t k = 0; k < p.size(); ++k)
        EXPECT_NEAR(fans[k], 4 * pi / 400, (std::abs(p[k].z) < 0.9 ? 0.3 : 1) * 4 * pi / 400);
}

// The inside of a bowl, seen from its floor: when the base bends, everything moves, and fans grow as the
// solid angle of the wall behind them does.
TEST(DirectionMesh, FansGrowAsTheMapOfMovedDirections) {
    const double wall = 3;
    const BaseCurvature base{0.03, 0.01, 0.5};
    const std::vector<Vec3> p = sphere(2000);
    auto moved = [&](const Vec3& d) {  // of a direction that meets a cylindrical wall at distance `wall`
        const double h = std::hypot(d.x, d.y), x = wall * d.x / h, y = wall * d.y / h;
        const Vec3 q = displaced_position(base, x, y, wall * d.z / h);
        const double length = std::sqrt(dot(q, q));
        return Vec3{q.x / length, q.y / length, q.z / length};
    };
    const DirectionMesh mesh = triangulate(p);
    std::vector<double> before, after;
    std::vector<Vec3> ends;
    for (const Vec3& d : p) ends.push_back(moved(d));
    fan_solid_angles(mesh, p, before);
    fan_solid_angles(mesh, ends, after);
    int checked = 0;
    for (size_t k = 0; k < p.size(); ++k) {
        if (std::abs(p[k].z) > 0.6) continue;
        const double phi = std::atan2(p[k].y, p[k].x), theta = std::acos(p[k].z), e = 1e-4;
        auto at = [&](double t, double f) {
            return moved({std::sin(t) * std::cos(f), std::sin(t) * std::sin(f), std::cos(t)});
        };
        auto half = [&](double sign) {
            return sign * solid_angle(at(theta - sign * e, phi - sign * e),
                                      at(theta + sign * e, phi - sign * e),
                                      at(theta + sign * e, phi + sign * e)) +
                   sign * solid_angle(at(theta - sign * e, phi - sign * e),
                                      at(theta + sign * e, phi + sign * e),
                                      at(theta - sign * e, phi + sign * e));
        };
        const double growth = std::abs(half(1)) / (4 * e * e * std::sin(theta));
        EXPECT_NEAR(after[k] / before[k], growth, 0.02) << k;
        ++checked;
    }
    EXPECT_GT(checked, 1000);
}

}  // namespace
}  // namespace gonio
