// The judge of curved bases: a relief really displaced from a cylinder or a sphere, and rays of Embree
// through it. Shares nothing with the engine but the definitions: light and view are told in the frame of the
// point that is seen, and a ray has left once it has been above the layer of the relief
// (visibility/crossings.h).
#pragma once
#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "base/random.h"
#include "material/local_frame.h"
#include "surface/generate.h"
#include "surface/height_field.h"
#include "visibility/curvature.h"
#include "visibility/view_map.h"

namespace gonio {

inline Vec3 operator+(const Vec3& a, const Vec3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec3 operator-(const Vec3& a, const Vec3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 operator*(double s, const Vec3& a) {
    return {s * a.x, s * a.y, s * a.z};
}

// Cells [x0, x0 + core) x [y0, y0 + core) of a surface with `margin` cells around them. Exact for cylinders;
// a sphere is laid out around the middle of the core, so that its cores must be small.
class CurvedPatch {
  public:
    CurvedPatch(const HeightField& surface, int x0, int y0, int core, int margin)
        : s_(surface),
          x0_(x0 - margin),
          y0_(y0 - margin),
          n_(core + 2 * margin),
          core_(core),
          margin_(margin) {
        for (const float h : surface.heights) top_ = std::max<double>(top_, h);
        device_ = rtcNewDevice(nullptr);
        scene_ = rtcNewScene(device_);
        rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
        RTCGeometry mesh = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0,
                                                                   RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                                   static_cast<size_t>(n_ + 1) * (n_ + 1)));
        for (int j = 0; j <= n_; ++j)
            for (int i = 0; i <= n_; ++i) {
                const Vec3 p = displaced(base_x(i), base_y(j), s_.at(x0_ + i, y0_ + j));
                nodes_.push_back(p);
                *vertex++ = static_cast<float>(p.x);
                *vertex++ = static_cast<float>(p.y);
                *vertex++ = static_cast<float>(p.z);
            }
        auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0,
                                                                     RTC_FORMAT_UINT3, 3 * sizeof(unsigned),
                                                                     2 * static_cast<size_t>(n_) * n_));
        for (int f = 0; f < 2 * n_ * n_; ++f)
            for (const int corner : corners(f)) *index++ = static_cast<unsigned>(corner);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene_, mesh);
        rtcReleaseGeometry(mesh);
        rtcCommitScene(scene_);
    }
    ~CurvedPatch() {
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    CurvedPatch(const CurvedPatch&) = delete;
    CurvedPatch& operator=(const CurvedPatch&) = delete;

    struct Point {
        Vec3 position, normal;
        double area = 1;      // of its facet, over that of the base
        double x = 0, y = 0;  // on the base
        size_t facet = 0;     // that a ray hit, as facet_index()
        // A direction told in the frame of the base there, in space.
        Vec3 in_space(const Vec3& local, const BaseCurvature& base) const {
            return turned_direction(local, base, -x, -y);
        }
    };
    // The point (u, v) of a cell of the core, as FacetPoint.
    Point point(int i, int j, int kind, double u, double v) const {
        const int facet = 2 * ((j + margin_) * n_ + i + margin_) + kind;
        const auto [a, b, c] = corners(facet);
        const double wb = kind == 0 ? u - v : u,
                     wc = kind == 0 ? v : v - u;  // (i+1,j), (i+1,j+1); or (i+1,j+1), (i,j+1)
        Point p = on_facet(facet);
        p.position = nodes_[a] + (wb * (nodes_[b] - nodes_[a])) + (wc * (nodes_[c] - nodes_[a]));
        p.x = base_x(i + margin_) + u * s_.pitch_x;
        p.y = base_y(j + margin_) + v * s_.pitch_y;
        return p;
    }

    // Of the core, from four random numbers in [0, 1): every facet with the same odds.
    Point point_of(const std::array<double, 4>& random) const {
        const int cell = std::min(static_cast<int>(random[0] * core_ * core_), core_ * core_ - 1);
        double u = random[1], v = random[2];
        const int kind = random[3] < 0.5 ? 0 : 1;
        if ((kind == 0) != (u >= v)) std::swap(u, v);
        return point(cell % core_, cell / core_, kind, u, v);
    }

    // What is seen at (x, y), in cells of the core, of the base from above the relief: a ray towards `view`,
    // told in the frame there, that passes that place of the plane z = 0 of the surface as given.
    bool see(double x, double y, const Vec3& view, Point* hit) const {
        const double base_x = (x - 0.5 * core_) * s_.pitch_x, base_y = (y - 0.5 * core_) * s_.pitch_y;
        const Vec3 w = turned_direction(view, s_.base, -base_x, -base_y);
        // Up to where the ray leaves the layer, in which it stands at height h after s if
        // (R + h)^2 = (R + start + s view.z)^2 + (s across)^2, across what is curved.
        const double c = std::cos(s_.base.direction), n = std::sin(s_.base.direction),
                     start = -s_.mean_height, kappa = s_.base.kappa_1,
                     across = s_.base.kappa_2 == 0 ? c * view.x + n * view.y : std::hypot(view.x, view.y),
                     a = kappa * (across * across + view.z * view.z), b = view.z * (1 + kappa * start),
                     q = (start - top_) * (2 + kappa * (start + top_));
        const double climb = -q / (b + std::sqrt(b * b - a * q));
        return trace(displaced(base_x, base_y, start) + (0.999999 * climb) * w, -1 * w, hit);
    }

    // The first facet from `origin` along `direction`, or nothing. (x, y): of the middle of the facet.
    bool trace(const Vec3& origin, const Vec3& direction, Point* hit) const {
        RTCRayHit ray{};
        ray.ray.org_x = static_cast<float>(origin.x);
        ray.ray.org_y = static_cast<float>(origin.y);
        ray.ray.org_z = static_cast<float>(origin.z);
        ray.ray.dir_x = static_cast<float>(direction.x);
        ray.ray.dir_y = static_cast<float>(direction.y);
        ray.ray.dir_z = static_cast<float>(direction.z);
        ray.ray.tnear = 1e-3f * static_cast<float>(s_.pitch_x);
        ray.ray.tfar = 1e30f;
        ray.ray.mask = ~0u;
        ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        rtcIntersect1(scene_, &context, &ray);
        if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID || left_layer(origin, direction, ray.ray.tfar))
            return false;
        *hit = on_facet(static_cast<int>(ray.hit.primID));
        hit->position = origin + (static_cast<double>(ray.ray.tfar) * direction);
        const int cell = static_cast<int>(ray.hit.primID) / 2;
        const double third = ray.hit.primID % 2 == 0 ? 2.0 / 3 : 1.0 / 3;
        hit->x = base_x(cell % n_) + third * s_.pitch_x;
        hit->y = base_y(cell / n_) + (1 - third) * s_.pitch_y;
        hit->facet = facet_index(s_.nx, s_.ny, 0, static_cast<int>(ray.hit.primID) % 2,
                                 wrap_index(y0_ + cell / n_, s_.ny), wrap_index(x0_ + cell % n_, s_.nx));
        return true;
    }
    int core() const { return core_; }
    const BaseCurvature& base() const { return s_.base; }

  private:
    double base_x(int i) const { return (i - margin_ - 0.5 * core_) * s_.pitch_x; }
    double base_y(int j) const { return (j - margin_ - 0.5 * core_) * s_.pitch_y; }
    std::array<int, 3> corners(int facet) const {
        const int cell = facet / 2, a = cell / n_ * (n_ + 1) + cell % n_;
        if (facet % 2 == 0) return {a, a + 1, a + n_ + 2};
        return {a, a + n_ + 2, a + n_ + 1};
    }
    Point on_facet(int facet) const {
        const auto [a, b, c] = corners(facet);
        const Vec3 n = cross(nodes_[b] - nodes_[a], nodes_[c] - nodes_[a]);
        const double length = std::sqrt(dot(n, n));
        Point p;
        p.normal = (1 / length) * n;
        p.area = length / (s_.pitch_x * s_.pitch_y);
        return p;
    }
    // Cylinders (kappa_2 = 0) unrolled exactly at every azimuth; else as seen from the middle of the core.
    Vec3 displaced(double x, double y, double h) const {
        const BaseCurvature& base = s_.base;
        if (base.kappa_2 != 0) return displaced_position(base, x, y, h);
        const double c = std::cos(base.direction), s = std::sin(base.direction), along = c * y - s * x;
        const Vec3 p = displaced_position(base, c * (c * x + s * y), s * (c * x + s * y), h);
        return {p.x - s * along, p.y + c * along, p.z};
    }
    // In a hollow: whether the ray stands above the layer on its way to `length`, which it does most where it
    // is nearest to the axis (cylinder) or centre (sphere).
    bool left_layer(const Vec3& origin, const Vec3& direction, double length) const {
        const double kappa = s_.base.kappa_1;
        if (!(kappa < 0)) return false;
        const double c = std::cos(s_.base.direction), s = std::sin(s_.base.direction);
        auto part = [&](Vec3 v) {
            if (s_.base.kappa_2 == 0) {
                const double across = c * v.x + s * v.y;
                return Vec3{across, 0, v.z};
            }
            return v;
        };
        const Vec3 from = part(origin - Vec3{0, 0, -1 / kappa}), to = part(direction);
        const double t = std::clamp(-dot(from, to) / dot(to, to), 0.0, length);
        const Vec3 nearest = from + (t * to);
        return -1 / kappa - std::sqrt(dot(nearest, nearest)) > top_;
    }

    const HeightField& s_;
    int x0_, y0_, n_, core_, margin_;
    double top_ = -1e300;
    std::vector<Vec3> nodes_;
    RTCDevice device_ = nullptr;
    RTCScene scene_ = nullptr;
};

// The relief of the tests and its whole period as patches that are exact: one on a cylinder, small ones on a
// sphere.
inline HeightField relief_on(const BaseCurvature& base, int size = 32) {
    HeightField surface = generate_gaussian(size, size, 1, 4, 0.7, 3);
    surface.base = base;
    return surface;
}
inline std::vector<std::unique_ptr<CurvedPatch>> patches_of(const HeightField& surface) {
    const int size = surface.nx, core = surface.base.kappa_2 == 0 ? size : size / 4, margin = 72;
    std::vector<std::unique_ptr<CurvedPatch>> patches;
    for (int y = 0; y < size; y += core)
        for (int x = 0; x < size; x += core)
            patches.push_back(std::make_unique<CurvedPatch>(surface, x, y, core, margin));
    return patches;
}

// Lambertian f of orders 1 .. n_orders each, and of all orders, at albedo 1 but for `all`.
struct TracedOrders {
    struct Value {
        double mean = 0, se = 0;
    };
    std::vector<Value> orders;  // [order - 1]
    Value all;                  // at `albedo`
};

// One view, every light; paths start at random points of the cores. patches: equal shares of the surface.
// Without a view: exitance, over the irradiance of the base, as the mean over facets, all of equal weight.
inline std::vector<TracedOrders> trace_view(const std::vector<CurvedPatch*>& patches,
                                            const std::vector<Vec3>& lights, const std::optional<Vec3>& view,
                                            int n_orders, double albedo, int paths, uint64_t seed) {
    constexpr int longest = 24;
    const size_t n_lights = lights.size();
    std::vector<std::vector<double>> sum(n_lights, std::vector<double>(n_orders + 1)), squares = sum;
    auto random = [&](int path, int bounce, int which) {
        return uniform_double(
            random_words(seed, static_cast<uint64_t>(path), static_cast<uint64_t>(bounce))[which]);
    };
    for (int path = 0; path < paths; ++path) {
        const CurvedPatch& patch = *patches[path % patches.size()];
        CurvedPatch::Point p =
            patch.point_of({random(path, 0, 0), random(path, 0, 1), random(path, 0, 2), random(path, 0, 3)});
        CurvedPatch::Point hit;
        double start = 1;
        if (view) {
            const Vec3 wo = p.in_space(*view, patch.base());
            start = p.area * dot(p.normal, wo) / (pi * view->z);
            if (!(start > 0) || patch.trace(p.position, wo, &hit)) continue;
        }
        std::vector<Vec3> wi;
        for (const Vec3& light : lights) wi.push_back(p.in_space(light, patch.base()));
        std::vector<std::vector<double>> found(n_lights, std::vector<double>(n_orders + 1));
        double power = albedo;
        for (int order = 1; order <= longest; ++order, power *= albedo) {
            for (size_t l = 0; l < n_lights; ++l) {
                const double cosine = dot(p.normal, wi[l]);
                if (!(cosine > 0) || patch.trace(p.position, wi[l], &hit)) continue;
                const double f = start * cosine / lights[l].z;
                if (order <= n_orders) found[l][order - 1] = f;
                found[l][n_orders] += power * f;
            }
            // Cosine-weighted: radiance times albedo.
            const double r = std::sqrt(random(path, order, 0)), phi = 2 * pi * random(path, order, 1);
            const Vec3 n = p.normal, side = std::abs(n.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
            Vec3 t = cross(side, n);
            t = (1 / std::sqrt(dot(t, t))) * t;
            const Vec3 b = cross(n, t);
            const Vec3 d = (r * std::cos(phi) * t) + (r * std::sin(phi) * b) + (std::sqrt(1 - r * r) * n);
            if (!patch.trace(p.position, d, &hit)) break;
            p.position = hit.position;
            p.normal = hit.normal;
        }
        for (size_t l = 0; l < n_lights; ++l)
            for (int k = 0; k <= n_orders; ++k) {
                sum[l][k] += found[l][k];
                squares[l][k] += found[l][k] * found[l][k];
            }
    }
    std::vector<TracedOrders> result(n_lights);
    for (size_t l = 0; l < n_lights; ++l)
        for (int k = 0; k <= n_orders; ++k) {
            const double mean = sum[l][k] / paths, variance = squares[l][k] / paths - mean * mean;
            const TracedOrders::Value value{mean, std::sqrt(variance / paths)};
            if (k < n_orders)
                result[l].orders.push_back(value);
            else
                result[l].all = value;
        }
    return result;
}

}  // namespace gonio
