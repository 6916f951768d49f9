// The judge: an unbiased path tracer for Lambertian reliefs. Slow, and sharing nothing with what it judges
// but the relief itself.
//
// A path starts from a point of a horizontal plane above the relief, stratified over the period, along the
// viewing direction; it bounces by cosine sampling until it escapes, and every vertex is connected to all
// lights (next-event estimation), so each path serves all lights, orders and channels. With the vertex k of a
// path carrying throughput prod(albedo_1..k), its estimate is
//     f(wi, wo) = 1 / (pi cos_i) sum_k throughput_k <n_k, wi>+ V(p_k, wi).
// Exact for the facets but for rounding: Embree's floats place a ray to about 1e-5 cell, which shows (0.1 %)
// where only slivers are lit or seen: slope * tan(theta) above about 2000.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/monitor.h"
#include "directions/direction.h"
#include "material/material.h"
#include "scattering/embree_scene.h"
#include "surface/height_field.h"

namespace gonio {

struct PathTracerOptions {
    long long paths =
        4096;  // from each view, rounded up to twice a square: two in each of the strata over the period
    int max_order = 0;        // 0: all orders
    int separate_orders = 0;  // K: slices 1..K of single orders beside slice 0, the sum
    uint64_t seed = 1;
    bool allow_skips = true;  // rays steeper than the steepest facet hit nothing and are not traced
};

struct RayCounts {
    long long camera = 0, bounce = 0, shadow = 0;  // traced
    long long spared = 0;                          // known to hit nothing
    long long lost = 0;                            // fell between facets: rounding
    RayCounts& operator+=(const RayCounts& other);
};

// Sums over the paths of one view, in double, each [light][slice][channel].
struct PathTally {
    std::vector<double> sum;             // of f
    std::vector<double> squared_spread;  // over strata, of (difference of the stratum's two paths)^2
    RayCounts rays;
};

class PathTracer {
  public:
    // surface and material must outlive the tracer.
    PathTracer(const HeightField& surface, const Lambertian& material, int n_channels,
               const PathTracerOptions& options);

    long long paths() const { return 2LL * strata_ * strata_; }
    // The paths of a view are traced in blocks of fixed size: the unit of work of a thread.
    int blocks() const;

    // Block `block` of view number `view` (which keys the random numbers). Thread-safe. Throws
    // Error(cancelled).
    PathTally trace(int view, const Vec3& wo, std::span<const Vec3> lights, int block,
                    const Monitor& monitor) const;

    // f = scale() * sum, standard error = scale() * sqrt(squared_spread).
    double scale() const;

  private:
    struct Vertices;
    Vertices trace_paths(int view, const Vec3& wo, int block, RayCounts& rays) const;
    Vec3 facet_normal(const SceneHit& hit) const;
    double albedo(const SceneHit& hit, int channel) const;
    // Whether a ray along d, d.z > 0 being up, can meet the relief at all (Lipschitz bound).
    bool can_hit(const Vec3& d) const;

    const HeightField& surface_;
    const Lambertian& material_;
    int n_channels_;
    PathTracerOptions options_;
    int strata_ = 1;  // along x and along y. Square even for a relief invariant along y: a few strata hold
                      // all the edges of its shadows, and rows of them that differ in their jitter alone are
                      // what makes its standard error honest
    double max_slope_ = 0;
    EmbreeScene scene_;
};

}  // namespace gonio
