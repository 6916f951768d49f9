// Paths of light between glossy facets of a relief that is really displaced: the judge of curved_glossy_test.
#pragma once
#include "agreement/curved_patch.h"
#include "material/facet_brdf.h"

namespace gonio {

// One isotropic material without maps, whose facets are told in frames of their own.
class FacetsInSpace {
  public:
    explicit FacetsInSpace(const Material& material) : brdf_(material, plane(), 0, 0, 0) {}

    // f in 1/sr; directions in space.
    double f(const Vec3& normal, const Vec3& wi, const Vec3& wo) const {
        double value;
        brdf_.eval(local(normal, wi), local(normal, wo), {&value, 1});
        return value;
    }
    // Continues a path that left towards wo; false if it ends. weight: f cos / density.
    bool sample(const Vec3& normal, const Vec3& wo, const std::array<double, 4>& random, Vec3* wi,
                double* weight) const {
        const auto drawn = brdf_.sample(local(normal, wo), random[0], random[1], random[2], {weight, 1});
        if (!drawn) return false;
        const auto [t, b] = axes(normal);
        *wi = (drawn->wi.x * t) + (drawn->wi.y * b) + (drawn->wi.z * normal);
        return true;
    }
    static Vec3 cosine_weighted(const Vec3& normal, const std::array<double, 4>& random) {
        const double r = std::sqrt(random[0]), phi = 2 * pi * random[1];
        const auto [t, b] = axes(normal);
        return (r * std::cos(phi) * t) + (r * std::sin(phi) * b) + (safe_sqrt(1 - r * r) * normal);
    }

  private:
    static const HeightField& plane() {
        static const HeightField flat = [] {
            HeightField s = generate_gaussian(4, 4, 1, 1, 0.1, 1);
            s.heights.assign(s.heights.size(), 0.0f);
            return s;
        }();
        return flat;
    }
    static std::pair<Vec3, Vec3> axes(const Vec3& n) {
        const Vec3 side = std::abs(n.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
        const Vec3 t = normalized(gonio::cross(side, n));
        return {t, gonio::cross(n, t)};
    }
    static Vec3 local(const Vec3& n, const Vec3& w) {
        const auto [t, b] = axes(n);
        return {dot(t, w), dot(b, w), dot(n, w)};
    }
    FacetBrdf brdf_;
};

// f of single orders; one view, every light; paths start at random points of the cores of patches that are
// equal shares of the surface. Without a view: irradiance of the facets, over that of the base, as the mean
// over them, all of equal weight.
inline std::vector<TracedOrders> trace_glossy(const std::vector<CurvedPatch*>& patches,
                                              const Material& material, const std::vector<Vec3>& lights,
                                              const std::optional<Vec3>& view, int n_orders, int paths,
                                              uint64_t seed) {
    const FacetsInSpace facets(material);
    const size_t n_lights = lights.size();
    std::vector<std::vector<double>> sum(n_lights, std::vector<double>(n_orders)), squares = sum;
    auto random = [&](int path, int bounce) {
        std::array<double, 4> numbers;
        for (int k = 0; k < 4; ++k)
            numbers[k] = uniform_double(
                random_words(seed, static_cast<uint64_t>(path), static_cast<uint64_t>(bounce))[k]);
        return numbers;
    };
    for (int path = 0; path < paths; ++path) {
        const CurvedPatch& patch = *patches[path % patches.size()];
        CurvedPatch::Point p = patch.point_of(random(path, 0)), hit;
        Vec3 wo;
        double throughput = 1;
        if (view) {
            wo = p.in_space(*view, patch.base());
            throughput = p.area * dot(p.normal, wo) / view->z;
            if (!(throughput > 0) || patch.trace(p.position, wo, &hit)) continue;
        }
        std::vector<Vec3> wi;
        for (const Vec3& light : lights) wi.push_back(p.in_space(light, patch.base()));
        for (int order = 0; order < n_orders; ++order) {
            for (size_t l = 0; l < n_lights; ++l) {
                const double cosine = dot(p.normal, wi[l]);
                if (!(cosine > 0) || patch.trace(p.position, wi[l], &hit)) continue;
                const double own = view || order > 0 ? facets.f(p.normal, wi[l], wo) : 1,
                             f = throughput * own * cosine / lights[l].z;
                sum[l][order] += f;
                squares[l][order] += f * f;
            }
            Vec3 d;
            double weight;
            const auto numbers = random(path, order + 1);
            if (view || order > 0) {
                if (!facets.sample(p.normal, wo, numbers, &d, &weight)) break;
            } else {
                d = FacetsInSpace::cosine_weighted(p.normal, numbers);
                weight = pi;
            }
            if (!patch.trace(p.position, d, &hit)) break;
            p = hit;
            wo = -1 * d;
            throughput *= weight;
        }
    }
    std::vector<TracedOrders> result(n_lights);
    for (size_t l = 0; l < n_lights; ++l)
        for (int k = 0; k < n_orders; ++k) {
            const double mean = sum[l][k] / paths, variance = squares[l][k] / paths - mean * mean;
            result[l].orders.push_back({mean, std::sqrt(variance / paths)});
        }
    return result;
}

}  // namespace gonio
