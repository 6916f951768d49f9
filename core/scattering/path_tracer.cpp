#include "scattering/path_tracer.h"

#include <algorithm>
#include <cmath>

#include "base/numeric.h"
#include "base/random.h"
#include "surface/facet_mesh.h"

namespace gonio {
namespace {

constexpr int strata_per_block = 512;

// Unit vector about n with density cos / pi: the normal plus a point of the unit sphere.
Vec3 cosine_sample(const Vec3& n, double u1, double u2) {
    const double z = 1 - 2 * u1, r = safe_sqrt(1 - z * z), phi = 2 * pi * u2;
    const Vec3 d{n.x + r * std::cos(phi), n.y + r * std::sin(phi), n.z + z};
    const double length = std::sqrt(dot(d, d));
    if (length < 1e-9) return n;
    return {d.x / length, d.y / length, d.z / length};
}

double steepest_facet(const HeightField& s) {
    double squared = 0;
    for (int j = 0; j < s.ny; ++j)
        for (int i = 0; i < s.nx; ++i)
            for (const int kind : {0, 1}) {
                const Gradient g = facet_gradient(s, kind, i, j);
                squared = std::max(squared, g.x * g.x + g.y * g.y);
            }
    return std::sqrt(squared);
}

}  // namespace

RayCounts& RayCounts::operator+=(const RayCounts& other) {
    camera += other.camera;
    bounce += other.bounce;
    shadow += other.shadow;
    spared += other.spared;
    lost += other.lost;
    return *this;
}

// Every vertex of every path of a block: what the lights see.
struct PathTracer::Vertices {
    std::vector<ScenePoint> point;
    std::vector<float> nx, ny, nz;  // unit normals, world
    std::vector<int> path, order;   // path inside the block; order 1, 2, ...
    std::vector<float> throughput;  // [vertex][channel]
};

PathTracer::PathTracer(const HeightField& surface, const Lambertian& material, int n_channels,
                       const PathTracerOptions& options)
    : surface_(surface),
      material_(material),
      n_channels_(n_channels),
      options_(options),
      max_slope_(steepest_facet(surface)),
      scene_(surface) {
    const double strata = std::max(1.0, static_cast<double>(options.paths) / 2);
    strata_ = static_cast<int>(std::ceil(std::sqrt(strata)));
}

int PathTracer::blocks() const {
    return static_cast<int>((paths() / 2 + strata_per_block - 1) / strata_per_block);
}

double PathTracer::scale() const {
    // Of an open surface only the hits inside its border count: a share of the period.
    const HeightField& s = surface_;
    const double measured = static_cast<double>(s.nx - 2 * s.border_x) * (s.ny - 2 * s.border_y);
    return static_cast<double>(s.nx) * s.ny / measured / static_cast<double>(paths());
}

Vec3 PathTracer::facet_normal(const SceneHit& hit) const {
    const Gradient g = facet_gradient(surface_, hit.kind, hit.i, hit.j);
    const double z = 1 / area_ratio(g);
    return {-g.x * z, -g.y * z, z};
}

double PathTracer::albedo(const SceneHit& hit, int channel) const {
    return material_.albedo.at(channel, hit.i, hit.j);
}

bool PathTracer::can_hit(const Vec3& d) const {
    return !options_.allow_skips || d.z <= max_slope_ * std::hypot(d.x, d.y) * (1 + 1e-6);
}

PathTracer::Vertices PathTracer::trace_paths(int view, const Vec3& wo, int block, RayCounts& counts) const {
    const HeightField& s = surface_;
    const long long first_stratum = static_cast<long long>(block) * strata_per_block;
    const int n_paths =
        2 * static_cast<int>(std::min<long long>(strata_per_block, paths() / 2 - first_stratum));
    const auto random = [&](int path, int order) {
        return random_words(options_.seed, static_cast<uint64_t>(view) << 32 | static_cast<uint32_t>(order),
                            2 * first_stratum + path);
    };

    std::vector<SceneRay> rays(n_paths), next_rays;
    std::vector<SceneHit> hits(n_paths);
    std::vector<int> path_of(n_paths), next_path_of;
    std::vector<float> throughput(static_cast<size_t>(n_paths) * n_channels_, 1.0f);
    const ScenePoint down = scene_.direction({-wo.x, -wo.y, -wo.z});
    for (int path = 0; path < n_paths; ++path) {
        // Strata in strips of two rows: neighbours in the list are neighbours on the relief, and packets stay
        // coherent.
        const long long stratum = first_stratum + path / 2;
        const long long strip = stratum / (2LL * strata_), in_strip = stratum % (2LL * strata_);
        const long long rows = std::min(2LL, strata_ - 2 * strip);
        const auto word = random(path, 0);
        const double x = (static_cast<double>(in_strip / rows) + uniform_double(word[0])) / strata_ * s.nx;
        const double y =
            (static_cast<double>(2 * strip + in_strip % rows) + uniform_double(word[1])) / strata_ * s.ny;
        rays[path] = {{static_cast<float>(x), static_cast<float>(y), scene_.top()}, down};
        path_of[path] = path;
    }
    counts.camera += n_paths;

    Vertices vertices;
    for (int order = 1; !rays.empty(); ++order) {
        hits.resize(rays.size());
        scene_.first_hits(rays, hits);
        next_rays.clear();
        next_path_of.clear();
        for (size_t k = 0; k < rays.size(); ++k) {
            const SceneHit& hit = hits[k];
            if (hit.kind == SceneHit::lost || (order == 1 && hit.kind == SceneHit::escaped)) ++counts.lost;
            if (hit.kind < 0) continue;
            const bool inside = hit.i >= s.border_x && hit.i < s.nx - s.border_x &&  //
                                hit.j >= s.border_y && hit.j < s.ny - s.border_y;
            if (order == 1 && !inside) continue;

            const int path = path_of[k];
            float* weight = &throughput[static_cast<size_t>(path) * n_channels_];
            float largest = 0;
            for (int c = 0; c < n_channels_; ++c) {
                weight[c] *= static_cast<float>(albedo(hit, c));
                largest = std::max(largest, weight[c]);
            }
            if (largest == 0) continue;
            const Vec3 n = facet_normal(hit);
            const ScenePoint point = scene_.surface_point(hit);
            vertices.point.push_back(point);
            vertices.nx.push_back(static_cast<float>(n.x));
            vertices.ny.push_back(static_cast<float>(n.y));
            vertices.nz.push_back(static_cast<float>(n.z));
            vertices.path.push_back(path);
            vertices.order.push_back(order);
            vertices.throughput.insert(vertices.throughput.end(), weight, weight + n_channels_);
            if (order == options_.max_order) continue;

            // Russian roulette: a vertex costs a shadow ray for every light, so faint paths are thinned.
            // Unbiased at albedo 1 too, where it never strikes: every path escapes by itself.
            const auto word = random(path, order);
            const float survival = std::min(1.0f, 2 * largest);
            if (uniform_float(word[2]) >= survival) continue;
            for (int c = 0; c < n_channels_; ++c) weight[c] /= survival;
            const Vec3 d = cosine_sample(n, uniform_double(word[0]), uniform_double(word[1]));
            if (!can_hit(d)) {
                ++counts.spared;
                continue;
            }
            next_rays.push_back({point, scene_.direction(d)});
            next_path_of.push_back(path);
        }
        std::swap(rays, next_rays);
        std::swap(path_of, next_path_of);
        counts.bounce += static_cast<long long>(rays.size());
    }
    return vertices;
}

PathTally PathTracer::trace(int view, const Vec3& wo, std::span<const Vec3> lights, int block,
                            const Monitor& monitor) const {
    monitor.check_cancelled();
    PathTally tally;
    const size_t n_slices = 1 + options_.separate_orders, n_values = n_slices * n_channels_;
    tally.sum.resize(lights.size() * n_values);
    tally.squared_spread.resize(lights.size() * n_values);
    const Vertices vertices = trace_paths(view, wo, block, tally.rays);

    const size_t n_vertices = vertices.point.size();
    std::vector<float> value(size_t{2} * strata_per_block * n_values);  // [path][slice][channel]
    std::vector<float> cosine(n_vertices);
    std::vector<int> facing(n_vertices);
    std::vector<uint8_t> visible(n_vertices);
    for (size_t l = 0; l < lights.size(); ++l) {
        if (l % 16 == 0) monitor.check_cancelled();
        const Vec3& wi = lights[l];
        const auto x = static_cast<float>(wi.x), y = static_cast<float>(wi.y), z = static_cast<float>(wi.z);
        for (size_t k = 0; k < n_vertices; ++k)
            cosine[k] = vertices.nx[k] * x + vertices.ny[k] * y + vertices.nz[k] * z;
        size_t n_facing = 0;
        for (size_t k = 0; k < n_vertices; ++k) {
            facing[n_facing] = static_cast<int>(k);
            n_facing += cosine[k] > 0;
        }
        if (can_hit(wi)) {
            scene_.visible(vertices.point, {facing.data(), n_facing}, scene_.direction(wi), visible);
            tally.rays.shadow += static_cast<long long>(n_facing);
        } else {
            std::fill_n(visible.begin(), n_facing, uint8_t{1});
            tally.rays.spared += static_cast<long long>(n_facing);
        }

        std::fill(value.begin(), value.end(), 0.0f);
        for (size_t k = 0; k < n_facing; ++k) {
            if (!visible[k]) continue;
            const int v = facing[k], order = vertices.order[v];
            float* of_path = &value[vertices.path[v] * n_values];
            for (int c = 0; c < n_channels_; ++c) {
                const float f = vertices.throughput[static_cast<size_t>(v) * n_channels_ + c] * cosine[v];
                of_path[c] += f;
                if (order <= options_.separate_orders) of_path[order * n_channels_ + c] += f;
            }
        }
        const double to_f = 1 / (pi * wi.z);
        for (int stratum = 0; stratum < strata_per_block; ++stratum) {
            const float *first = &value[2 * stratum * n_values], *second = first + n_values;
            for (size_t k = 0; k < n_values; ++k) {
                const double a = to_f * first[k], b = to_f * second[k];
                tally.sum[l * n_values + k] += a + b;
                tally.squared_spread[l * n_values + k] += (a - b) * (a - b);
            }
        }
    }
    return tally;
}

}  // namespace gonio
