#include "scattering/path_tracer.h"

#include <algorithm>
#include <array>
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

// By its bounds, one after the other: the engine bins by tables.
int cell_with(std::span<const ReceiverCell> cells, const Vec3& d) {
    const double theta_deg = degrees(safe_acos(d.z)), phi_deg = degrees(std::atan2(d.y, d.x));
    for (size_t k = 0; k < cells.size(); ++k) {
        const ReceiverCell& cell = cells[k];
        if (theta_deg < cell.theta_min_deg || theta_deg >= cell.theta_max_deg) continue;
        const double past_deg = phi_deg - cell.phi_min_deg;
        if (past_deg - 360 * std::floor(past_deg / 360) < cell.phi_max_deg - cell.phi_min_deg)
            return static_cast<int>(k);
    }
    return -1;
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

// Where a path meets the relief, and what it carries.
struct PathTracer::Vertex {
    int path, order;  // path inside the block; order 1, 2, ...
    const SceneHit& hit;
    ScenePoint point;
    Vec3 wo;                         // where it came from
    std::span<float> throughput;     // before the vertex
    std::array<uint32_t, 4> random;  // [2]: Russian roulette
};

// Every vertex of every path of a block: what the lights see.
struct PathTracer::Vertices {
    std::vector<ScenePoint> point;
    std::vector<float> nx, ny, nz;  // unit normals, world
    std::vector<int> path, order;
    std::vector<float> throughput;  // [vertex][channel]; of Lambertian facets with the vertex's own albedo
    std::vector<FacetBrdf> facet;   // unless Lambertian
    std::vector<Vec3> wo;

    void add(const Vertex& vertex, const Vec3& n) {
        point.push_back(vertex.point);
        nx.push_back(static_cast<float>(n.x));
        ny.push_back(static_cast<float>(n.y));
        nz.push_back(static_cast<float>(n.z));
        path.push_back(vertex.path);
        order.push_back(vertex.order);
        throughput.insert(throughput.end(), vertex.throughput.begin(), vertex.throughput.end());
    }
};

PathTracer::PathTracer(const HeightField& surface, const Material& material, const PathTracerOptions& options)
    : surface_(surface),
      material_(material),
      lambertian_(pure_lambertian(material)),
      n_channels_(static_cast<int>(material.channels.size())),
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

bool PathTracer::can_hit(const Vec3& d) const {
    return !options_.allow_skips || d.z <= max_slope_ * std::hypot(d.x, d.y) * (1 + 1e-6);
}

int PathTracer::paths_of(int block) const {
    const long long first_stratum = static_cast<long long>(block) * strata_per_block;
    return 2 * static_cast<int>(std::min<long long>(strata_per_block, paths() / 2 - first_stratum));
}

template <class Scatter, class Escape>
void PathTracer::walk(int stream, const Vec3& from, int block, RayCounts& counts, Scatter&& scatter,
                      Escape&& escape) const {
    const HeightField& s = surface_;
    const long long first_stratum = static_cast<long long>(block) * strata_per_block;
    const int n_paths = paths_of(block);
    const auto random = [&](int path, int order) {
        return random_words(options_.seed, static_cast<uint64_t>(stream) << 32 | static_cast<uint32_t>(order),
                            2 * first_stratum + path);
    };

    // Rays on their way, of which path, and where they go.
    std::vector<SceneRay> rays(n_paths), next_rays;
    std::vector<int> path_of(n_paths), next_path_of;
    std::vector<Vec3> heading(n_paths, {-from.x, -from.y, -from.z}), next_heading;
    std::vector<SceneHit> hits;
    std::vector<float> throughputs(static_cast<size_t>(n_paths) * n_channels_, 1.0f);
    const ScenePoint down = scene_.direction(heading.front());
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

    for (int order = 1; !rays.empty(); ++order) {
        hits.resize(rays.size());
        scene_.first_hits(rays, hits);
        next_rays.clear();
        next_path_of.clear();
        next_heading.clear();
        for (size_t k = 0; k < rays.size(); ++k) {
            const SceneHit& hit = hits[k];
            const int path = path_of[k];
            const std::span<float> throughput(&throughputs[static_cast<size_t>(path) * n_channels_],
                                              static_cast<size_t>(n_channels_));
            if (hit.kind == SceneHit::lost || (order == 1 && hit.kind == SceneHit::escaped)) ++counts.lost;
            if (hit.kind == SceneHit::escaped && order > 1) escape(path, order - 1, heading[k], throughput);
            if (hit.kind < 0 || (options_.max_order > 0 && order > options_.max_order)) continue;
            const bool inside = hit.i >= s.border_x && hit.i < s.nx - s.border_x &&  //
                                hit.j >= s.border_y && hit.j < s.ny - s.border_y;
            if (order == 1 && !inside) continue;

            const Vec3 wo{-heading[k].x, -heading[k].y, -heading[k].z};
            const Vertex vertex{
                path, order, hit, scene_.surface_point(hit), wo, throughput, random(path, order)};
            const std::optional<Vec3> d = scatter(vertex);
            if (!d) continue;
            // Russian roulette: a vertex costs a shadow ray for every light, so faint paths are thinned.
            // Unbiased at albedo 1 too, where it never strikes: every path escapes by itself.
            const float survival =
                std::min(1.0f, 2 * *std::max_element(throughput.begin(), throughput.end()));
            if (uniform_float(vertex.random[2]) >= survival) continue;
            for (float& weight : throughput) weight /= survival;
            if (!can_hit(*d)) {
                ++counts.spared;
                escape(path, order, *d, throughput);
                continue;
            }
            next_rays.push_back({vertex.point, scene_.direction(*d)});
            next_path_of.push_back(path);
            next_heading.push_back(*d);
        }
        std::swap(rays, next_rays);
        std::swap(path_of, next_path_of);
        std::swap(heading, next_heading);
        counts.bounce += static_cast<long long>(rays.size());
    }
}

std::optional<Vec3> PathTracer::sample(const Vertex& vertex, const FacetBrdf& facet) const {
    std::vector<double> weight(n_channels_);
    const auto& word = vertex.random;
    const auto sample = facet.sample(vertex.wo, uniform_double(word[3]), uniform_double(word[0]),
                                     uniform_double(word[1]), weight);
    if (!sample) return std::nullopt;
    for (int c = 0; c < n_channels_; ++c) vertex.throughput[c] *= static_cast<float>(weight[c]);
    return sample->wi;
}

void PathTracer::add_to_path(std::span<const float> f, int order, std::span<float> of_path) const {
    for (int c = 0; c < n_channels_; ++c) {
        of_path[c] += f[c];
        if (order <= options_.separate_orders) of_path[order * n_channels_ + c] += f[c];
    }
}

// To value[path][slice][channel]: pi throughput f_micro cos of the vertices that the light wi sees.
void PathTracer::add_lambertian(const Vertices& vertices, std::span<const int> seen, const Vec3& wi,
                                std::span<float> value) const {
    const auto x = static_cast<float>(wi.x), y = static_cast<float>(wi.y), z = static_cast<float>(wi.z);
    std::vector<float> f(n_channels_);
    for (const int v : seen) {
        const float cosine = vertices.nx[v] * x + vertices.ny[v] * y + vertices.nz[v] * z;
        for (int c = 0; c < n_channels_; ++c)
            f[c] = vertices.throughput[static_cast<size_t>(v) * n_channels_ + c] * cosine;
        add_to_path(f, vertices.order[v], value.subspan(vertices.path[v] * n_values(), n_values()));
    }
}

void PathTracer::add_any(const Vertices& vertices, std::span<const int> seen, const Vec3& wi,
                         std::span<float> value) const {
    std::vector<float> f(n_channels_);
    std::vector<double> f_micro(n_channels_);
    for (const int v : seen) {
        const FacetBrdf& facet = vertices.facet[v];
        facet.eval(wi, vertices.wo[v], f_micro);
        const double cosine = pi * dot(facet.normal(), wi);
        for (int c = 0; c < n_channels_; ++c)
            f[c] = vertices.throughput[static_cast<size_t>(v) * n_channels_ + c] *
                   static_cast<float>(f_micro[c] * cosine);
        add_to_path(f, vertices.order[v], value.subspan(vertices.path[v] * n_values(), n_values()));
    }
}

PathTally PathTracer::trace(int view, const Vec3& wo, std::span<const Vec3> lights, int block,
                            const Monitor& monitor) const {
    monitor.check_cancelled();
    PathTally tally;
    tally.sum.resize(lights.size() * n_values());
    tally.squared_spread.resize(lights.size() * n_values());
    Vertices vertices;
    const auto scatter = [&](const Vertex& vertex) -> std::optional<Vec3> {
        const FacetBrdf brdf = facet(vertex.hit);
        const bool last = vertex.order == options_.max_order;
        if (!lambertian_) {
            vertices.add(vertex, brdf.normal());
            vertices.facet.push_back(brdf);
            vertices.wo.push_back(vertex.wo);
            return last ? std::nullopt : sample(vertex, brdf);
        }
        float largest = 0;
        for (int c = 0; c < n_channels_; ++c) {
            float& weight = vertex.throughput[c];
            weight *= static_cast<float>(lambertian_->albedo.at(c, vertex.hit.i, vertex.hit.j));
            largest = std::max(largest, weight);
        }
        if (largest == 0) return std::nullopt;
        vertices.add(vertex, brdf.normal());
        if (last) return std::nullopt;
        return cosine_sample(brdf.normal(), uniform_double(vertex.random[0]),
                             uniform_double(vertex.random[1]));
    };
    walk(view, wo, block, tally.rays, scatter, [](int, int, const Vec3&, std::span<const float>) {});

    const size_t n_vertices = vertices.point.size();
    std::vector<float> value(size_t{2} * strata_per_block * n_values());  // [path][slice][channel]
    std::vector<int> facing(n_vertices), seen;
    std::vector<uint8_t> visible(n_vertices);
    for (size_t l = 0; l < lights.size(); ++l) {
        if (l % 16 == 0) monitor.check_cancelled();
        const Vec3& wi = lights[l];
        const auto x = static_cast<float>(wi.x), y = static_cast<float>(wi.y), z = static_cast<float>(wi.z);
        size_t n_facing = 0;
        for (size_t k = 0; k < n_vertices; ++k) {
            facing[n_facing] = static_cast<int>(k);
            n_facing += vertices.nx[k] * x + vertices.ny[k] * y + vertices.nz[k] * z > 0;
        }
        if (can_hit(wi)) {
            scene_.visible(vertices.point, {facing.data(), n_facing}, scene_.direction(wi), visible);
            tally.rays.shadow += static_cast<long long>(n_facing);
        } else {
            std::fill_n(visible.begin(), n_facing, uint8_t{1});
            tally.rays.spared += static_cast<long long>(n_facing);
        }
        seen.clear();
        for (size_t k = 0; k < n_facing; ++k)
            if (visible[k]) seen.push_back(facing[k]);
        std::fill(value.begin(), value.end(), 0.0f);
        if (lambertian_)
            add_lambertian(vertices, seen, wi, value);
        else
            add_any(vertices, seen, wi, value);
        const double to_f = 1 / (pi * wi.z);
        add_strata(value, to_f, l * n_values(), tally);
    }
    return tally;
}

void PathTracer::add_strata(std::span<const float> value, double unit, size_t at, PathTally& tally) const {
    for (int stratum = 0; stratum < strata_per_block; ++stratum) {
        const auto first = value.subspan(2 * stratum * n_values(), n_values()),
                   second = value.subspan((2 * stratum + 1) * n_values(), n_values());
        for (size_t k = 0; k < n_values(); ++k) {
            const double a = unit * first[k], b = unit * second[k];
            tally.sum[at + k] += a + b;
            tally.squared_spread[at + k] += (a - b) * (a - b);
        }
    }
}

PathTally PathTracer::trace_environment(int view, const Vec3& wo, const Environment& environment, int block,
                                        const Monitor& monitor) const {
    monitor.check_cancelled();
    PathTally tally;
    tally.sum.resize(n_values());
    tally.squared_spread.resize(n_values());
    std::vector<float> value(size_t{2} * strata_per_block * n_values()), light(n_channels_);
    const auto scatter = [&](const Vertex& vertex) { return sample(vertex, facet(vertex.hit)); };
    const auto escape = [&](int path, int order, const Vec3& direction, std::span<const float> throughput) {
        for (int c = 0; c < n_channels_; ++c)
            light[c] = throughput[c] * static_cast<float>(environment.at(c, direction));
        add_to_path(light, order, std::span(value).subspan(path * n_values(), n_values()));
    };
    walk(view, wo, block, tally.rays, scatter, escape);
    add_strata(value, 1, 0, tally);
    return tally;
}

PathTally PathTracer::trace_into_cells(int light, const Vec3& wi, std::span<const ReceiverCell> cells,
                                       int block, const Monitor& monitor) const {
    monitor.check_cancelled();
    PathTally tally;
    tally.sum.resize(cells.size() * n_values());
    tally.squared_spread.resize(cells.size() * n_values());
    // One cell a path at most: -1 for those that are absorbed, lost or go elsewhere.
    std::vector<int> cell_of(paths_of(block), -1);
    std::vector<float> value(cell_of.size() * n_values());
    const auto scatter = [&](const Vertex& vertex) { return sample(vertex, facet(vertex.hit)); };
    const auto escape = [&](int path, int order, const Vec3& d, std::span<const float> throughput) {
        cell_of[path] = cell_with(cells, d);
        add_to_path(throughput, order, std::span(value).subspan(path * n_values(), n_values()));
    };
    walk(light, wi, block, tally.rays, scatter, escape);

    const auto add = [&](int cell, size_t k, double sum, double difference) {
        if (cell < 0) return;
        tally.sum[cell * n_values() + k] += sum;
        tally.squared_spread[cell * n_values() + k] += difference * difference;
    };
    for (size_t path = 0; path < cell_of.size(); path += 2)
        for (size_t k = 0; k < n_values(); ++k) {
            const double a = value[path * n_values() + k], b = value[(path + 1) * n_values() + k];
            if (cell_of[path] == cell_of[path + 1]) {
                add(cell_of[path], k, a + b, a - b);
            } else {
                add(cell_of[path], k, a, a);
                add(cell_of[path + 1], k, b, b);
            }
        }
    for (size_t cell = 0; cell < cells.size(); ++cell)
        for (size_t k = 0; k < n_values(); ++k) {
            const double to_f = 1 / projected_solid_angle(cells[cell]);
            tally.sum[cell * n_values() + k] *= to_f;
            tally.squared_spread[cell * n_values() + k] *= to_f * to_f;
        }
    return tally;
}

}  // namespace gonio
