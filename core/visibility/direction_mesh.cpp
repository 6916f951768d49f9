#include "visibility/direction_mesh.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace gonio {
namespace {

Vec3 minus(const Vec3& a, const Vec3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double determinant(const Vec3& a, const Vec3& b, const Vec3& c) {
    return dot(a, cross(b, c));
}

// How far d lies outside the plane through a, b, c, times twice the area of the triangle.
double outside(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    return dot(cross(minus(b, a), minus(c, a)), minus(d, a));
}

// Four directions that span a solid.
std::array<int, 4> first_tetrahedron(const std::vector<Vec3>& p) {
    const int n = static_cast<int>(p.size());
    auto farthest = [&](auto&& measure) {
        int best = 0;
        double most = -1;
        for (int k = 0; k < n; ++k)
            if (const double m = measure(p[k]); m > most) most = m, best = k;
        return best;
    };
    const int a = 0;
    const int b = farthest([&](const Vec3& q) { return dot(minus(q, p[a]), minus(q, p[a])); });
    const int c = farthest([&](const Vec3& q) {
        const Vec3 normal = cross(minus(p[b], p[a]), minus(q, p[a]));
        return dot(normal, normal);
    });
    const int d = farthest([&](const Vec3& q) { return std::abs(outside(p[a], p[b], p[c], q)); });
    if (outside(p[a], p[b], p[c], p[d]) > 0) return {a, c, b, d};
    return {a, b, c, d};
}

}  // namespace

DirectionMesh triangulate(const std::vector<Vec3>& directions) {
    const auto [a, b, c, d] = first_tetrahedron(directions);
    std::vector<std::array<int, 3>> faces{{a, b, c}, {a, d, b}, {b, d, c}, {c, d, a}};
    for (int k = 0; k < static_cast<int>(directions.size()); ++k) {
        if (k == a || k == b || k == c || k == d) continue;
        // Faces that the new direction sees make way for a fan over their rim.
        const auto seen = std::partition(faces.begin(), faces.end(), [&](const std::array<int, 3>& f) {
            return outside(directions[f[0]], directions[f[1]], directions[f[2]], directions[k]) <= 0;
        });
        std::set<std::pair<int, int>> edges;
        for (auto f = seen; f != faces.end(); ++f)
            for (int side = 0; side < 3; ++side) edges.insert({(*f)[side], (*f)[(side + 1) % 3]});
        faces.erase(seen, faces.end());
        for (const auto& [from, to] : edges)
            if (!edges.contains({to, from})) faces.push_back({from, to, k});
    }
    return {std::move(faces)};
}

double solid_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
    return 2 * std::atan2(determinant(a, b, c), 1 + dot(a, b) + dot(b, c) + dot(c, a));
}

void fan_solid_angles(const DirectionMesh& mesh, const std::vector<Vec3>& directions,
                      std::vector<double>& fans) {
    fans.assign(directions.size(), 0.0);
    for (const auto& [a, b, c] : mesh.triangles) {
        const double third = solid_angle(directions[a], directions[b], directions[c]) / 3;
        for (const int corner : {a, b, c}) fans[corner] += third;
    }
}

}  // namespace gonio
