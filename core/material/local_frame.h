// The frame of a facet, in which lobes are written: z along the normal, x along the tangent.
#pragma once
#include "directions/direction.h"
#include "surface/facet_mesh.h"

namespace gonio {

inline Vec3 normalized(const Vec3& v) {
    const double scale = 1 / std::sqrt(dot(v, v));
    return {v.x * scale, v.y * scale, v.z * scale};
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec3 half_vector(const Vec3& a, const Vec3& b) {
    return normalized({a.x + b.x, a.y + b.y, a.z + b.z});
}
// w mirrored at the unit vector h.
inline Vec3 mirrored(const Vec3& w, const Vec3& h) {
    const double twice = 2 * dot(w, h);
    return {twice * h.x - w.x, twice * h.y - w.y, twice * h.z - w.z};
}

struct LocalFrame {
    Vec3 tangent, bitangent, normal;

    // The tangent stands above (cos rotation, sin rotation) on the facet; bitangent = normal x tangent.
    LocalFrame(const Gradient& g, double rotation_deg) {
        const double rotation = radians(rotation_deg), x = std::cos(rotation), y = std::sin(rotation),
                     z = 1 / area_ratio(g);
        normal = {-g.x * z, -g.y * z, z};
        tangent = normalized({x, y, g.x * x + g.y * y});
        bitangent = cross(normal, tangent);
    }
    Vec3 to_local(const Vec3& w) const { return {dot(tangent, w), dot(bitangent, w), dot(normal, w)}; }
    Vec3 to_world(const Vec3& w) const {
        return {tangent.x * w.x + bitangent.x * w.y + normal.x * w.z,
                tangent.y * w.x + bitangent.y * w.y + normal.y * w.z,
                tangent.z * w.x + bitangent.z * w.y + normal.z * w.z};
    }
};

}  // namespace gonio
