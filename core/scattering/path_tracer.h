// The judge: an unbiased path tracer for reliefs of any material. Slow, and sharing nothing with what it
// judges but the relief itself and the reflectance of a facet (material/facet_brdf.h).
//
// A path starts from a point of a horizontal plane above the relief, stratified over the period, and bounces
// by sampling the facets' reflectance until it escapes.
//
// Point directions: it starts along the viewing direction, and every vertex is connected to all lights
// (next-event estimation), so each path serves all lights, orders and channels. With throughput_k, the
// product of f_micro cos / pdf over the vertices before k, its estimate is
//     f(wi, wo) = 1 / cos_i sum_k throughput_k f_micro(wi, wo_k) <n_k, wi>+ V(p_k, wi).
// Receiver cells: it starts along the light, and its throughput goes to the cell that it escapes into, over
// the projected solid angle of that. So mirrors are seen, too.
//
// Exact for the facets but for rounding: Embree's floats place a ray to about 1e-5 cell, which shows (0.1 %)
// where only slivers are lit or seen: slope * tan(theta) above about 2000.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/monitor.h"
#include "directions/cells.h"
#include "directions/direction.h"
#include "material/facet_brdf.h"
#include "scattering/embree_scene.h"
#include "scattering/environment.h"
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

// Sums over the paths of one view (or light), in double, each [light (or cell)][slice][channel].
struct PathTally {
    std::vector<double> sum;             // of f
    std::vector<double> squared_spread;  // over strata, of (difference of the stratum's two paths)^2
    RayCounts rays;
};

class PathTracer {
  public:
    // surface and material must outlive the tracer.
    PathTracer(const HeightField& surface, const Material& material, const PathTracerOptions& options);

    long long paths() const { return 2LL * strata_ * strata_; }
    // The paths of a view are traced in blocks of fixed size: the unit of work of a thread.
    int blocks() const;

    // Block `block` of view number `view` (which keys the random numbers). What has no density (mirrors) is
    // not met by lights of a single direction. Thread-safe. Throws Error(cancelled).
    PathTally trace(int view, const Vec3& wo, std::span<const Vec3> lights, int block,
                    const Monitor& monitor) const;

    // The same from light number `light` into cells that do not overlap, [cell][slice][channel]; what escapes
    // into none of them is left out.
    PathTally trace_into_cells(int light, const Vec3& wi, std::span<const ReceiverCell> cells, int block,
                               const Monitor& monitor) const;

    // The view under an environment alone: sum is of the radiance that it sees, [slice][channel]. Paths look
    // the light up where they escape, so that every reflectance is met, mirrors too; small bright sources are
    // met by chance, and are noise. environment: a channel for each of the material's.
    PathTally trace_environment(int view, const Vec3& wo, const Environment& environment, int block,
                                const Monitor& monitor) const;

    // f = scale() * sum, standard error = scale() * sqrt(squared_spread).
    double scale() const;

  private:
    struct Vertices;
    struct Vertex;
    // Paths that start against the direction `from`. scatter(vertex) records what it wants of the vertex,
    // multiplies the path's throughput by what the facet makes of it, and returns where the path goes on, or
    // nothing. escape(path, order, direction, throughput) is told of those that leave after `order` bounces.
    template <class Scatter, class Escape>
    void walk(int stream, const Vec3& from, int block, RayCounts& counts, Scatter&& scatter,
              Escape&& escape) const;
    std::optional<Vec3> sample(const Vertex& vertex, const FacetBrdf& facet) const;
    // Adds the paths' values, [path][slice][channel], each times `unit`, to the tally's entries from `at` on.
    void add_strata(std::span<const float> value, double unit, size_t at, PathTally& tally) const;
    int paths_of(int block) const;
    FacetBrdf facet(const SceneHit& hit) const { return {material_, surface_, hit.kind, hit.i, hit.j}; }
    void add_lambertian(const Vertices& vertices, std::span<const int> seen, const Vec3& wi,
                        std::span<float> value) const;
    void add_any(const Vertices& vertices, std::span<const int> seen, const Vec3& wi,
                 std::span<float> value) const;
    void add_to_path(std::span<const float> f, int order, std::span<float> of_path) const;
    size_t n_values() const { return (1 + static_cast<size_t>(options_.separate_orders)) * n_channels_; }
    // Whether a ray along d, d.z > 0 being up, can meet the relief at all (Lipschitz bound).
    bool can_hit(const Vec3& d) const;

    const HeightField& surface_;
    const Material& material_;
    const Lambertian* lambertian_;  // if the material is that alone: its vertices need not be evaluated
    int n_channels_;
    PathTracerOptions options_;
    int strata_ = 1;  // along x and along y. Square even for a relief invariant along y: a few strata hold
                      // all the edges of its shadows, and rows of them that differ in their jitter alone are
                      // what makes its standard error honest
    double max_slope_ = 0;
    EmbreeScene scene_;
};

}  // namespace gonio
