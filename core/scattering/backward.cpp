#include "scattering/backward.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "material/facet_brdf.h"
#include "surface/facet_mesh.h"

namespace gonio {
namespace {

// The walk of all places at once, order by order.
class Walk {
  public:
    Walk(const HeightField& surface, const Material& material, const Environment& sky, const TraceGrid& grid,
         const EnvironmentSamples& lights, size_t n_places)
        : surface_(surface),
          material_(material),
          sky_(sky),
          grid_(grid),
          lights_(lights),
          n_channels_(material.channels.size()),
          factors_(n_channels_),
          throughput_(n_places * n_channels_, 1.0f),
          arriving_(n_places * n_channels_),
          looks_at_sky_(n_places) {
        for (RayBatch* batch : {&vertices_, &rays_, &shadows_, &blocked_, &escaped_})
            batch->reserve(n_places);
    }

    // A first vertex.
    void see(int kind, int i, int j, float u, float v, const Vec3& view) {
        const auto id = static_cast<int32_t>(vertices_.n);
        vertices_.kind[id] = kind;
        vertices_.add(grid_, i, j, u, v, facet_height(grid_, kind, i, j, u, v), {-view.x, -view.y, -view.z},
                      id);
    }

    // random: a function that gives four uniform words, another four at each call.
    template <class Random>
    BackwardTally run(int max_order, double mean_sky, bool has_density, Random&& random,
                      std::vector<double>& radiance) {
        BackwardTally tally;
        const auto leave = [&](int32_t id) {
            for (size_t c = 0; c < n_channels_; ++c)
                tally.left += mean_sky * throughput_[id * n_channels_ + c] / static_cast<double>(n_channels_);
        };
        const int most = max_order > 0 ? max_order : most_backward_orders;
        for (int order = 1; order <= most && vertices_.n > 0; ++order) {
            for (size_t k = 0; k < vertices_.n; ++k) scatter(k, has_density, random);
            tally.rays += static_cast<double>(rays_.n + shadows_.n);
            std::vector<int32_t> lost;
            tally.rays_lost += static_cast<double>(trace_rays(grid_, shadows_, blocked_, escaped_, lost));
            for (size_t k = 0; k < escaped_.n; ++k)
                for (size_t c = 0; c < n_channels_; ++c) {
                    const size_t at = escaped_.id[k] * n_channels_ + c;
                    radiance[at] += arriving_[at];
                }
            lost.clear();
            tally.rays_lost += static_cast<double>(trace_rays(grid_, rays_, vertices_, escaped_, lost));
            for (size_t k = 0; k < escaped_.n; ++k) look_at_sky(k, radiance);
            for (const int32_t id : lost) leave(id);
        }
        // What a limit on the orders leaves out is asked for.
        for (size_t k = 0; k < vertices_.n && max_order == 0; ++k) leave(vertices_.id[k]);
        for (const double found : radiance) tally.seen += found / static_cast<double>(n_channels_);
        return tally;
    }

  private:
    Vec3 metric(const RayBatch& batch, size_t k) const {
        return {batch.dx[k], batch.dy[k] / grid_.aspect, batch.dz[k]};
    }

    // From a vertex on: a ray towards the environment, and one that goes on.
    template <class Random>
    void scatter(size_t k, bool has_density, Random&& random) {
        const int kind = vertices_.kind[k], i = vertices_.i[k], j = vertices_.j[k];
        const int32_t id = vertices_.id[k];
        const float u = vertices_.u[k], v = vertices_.v[k], z = vertices_.z[k];
        const Vec3 along = metric(vertices_, k), wo{-along.x, -along.y, -along.z};
        const FacetBrdf brdf(material_, surface_, kind, i, j);
        if (!(dot(brdf.normal(), wo) > 0)) {
            // From behind, by rounding, at an edge: on as it came.
            rays_.add(grid_, i, j, u, v, z, along, id);
            return;
        }
        float* throughput = &throughput_[id * n_channels_];
        double uniform[4] = {};
        if (has_density) {
            const auto words = random();
            for (int n = 0; n < 4; ++n) uniform[n] = uniform_double(words[n]);
            const size_t n_lights = lights_.directions.size(),
                         light = static_cast<size_t>(uniform[3] * static_cast<double>(n_lights));
            const Vec3& wi = lights_.directions[light];
            if (const double cosine = dot(brdf.normal(), wi); cosine > 0) {
                brdf.eval(wi, wo, factors_);
                for (size_t c = 0; c < n_channels_; ++c)
                    arriving_[id * n_channels_ + c] =
                        static_cast<float>(throughput[c] * factors_[c] * cosine *
                                           static_cast<double>(n_lights) * lights_.light[c][light]);
                shadows_.add(grid_, i, j, u, v, z, wi, id);
            }
        }
        const auto sample = brdf.sample(wo, uniform[0], uniform[1], uniform[2], factors_);
        if (!sample) return;  // absorbed
        for (size_t c = 0; c < n_channels_; ++c)
            throughput[c] = static_cast<float>(throughput[c] * factors_[c]);
        looks_at_sky_[id] = sample->is_delta;  // else the environment has been counted above
        rays_.add(grid_, i, j, u, v, z, sample->wi, id);
    }

    void look_at_sky(size_t k, std::vector<double>& radiance) const {
        const int32_t id = escaped_.id[k];
        if (!looks_at_sky_[id]) return;
        const Vec3 direction = metric(escaped_, k);
        for (size_t c = 0; c < n_channels_; ++c)
            radiance[id * n_channels_ + c] +=
                throughput_[id * n_channels_ + c] * sky_.at(static_cast<int>(c), direction);
    }

    const HeightField& surface_;
    const Material& material_;
    const Environment& sky_;
    const TraceGrid& grid_;
    const EnvironmentSamples& lights_;
    const size_t n_channels_;
    std::vector<double> factors_;  // of one reflection
    std::vector<float> throughput_,
        arriving_;  // [place][channel]; of the path, of its ray to the environment
    std::vector<uint8_t> looks_at_sky_;
    RayBatch vertices_, rays_, shadows_, blocked_, escaped_;
};

}  // namespace

BackwardTracer::BackwardTracer(const HeightField& surface, const Material& material, const Environment& sky,
                               int max_order)
    : surface_(surface),
      material_(material),
      sky_(sky),
      max_order_(max_order),
      has_density_(
          std::any_of(material.lobes.begin(), material.lobes.end(),
                      [](const WeightedLobe& part) { return !std::holds_alternative<Mirror>(part.lobe); })),
      mean_sky_(0),
      grid_(make_trace_grid(surface)) {
    for (int c = 0; c < sky.n_channels; ++c)
        mean_sky_ = std::max(mean_sky_, horizontal_irradiance(sky, c) / pi);
}

double BackwardTracer::estimated_bytes(const HeightField& surface) {
    return 24.0 * surface.nx * surface.ny;  // corners and two maxima a cell
}

BackwardTally BackwardTracer::trace(const SeenPlaces& places, const EnvironmentSamples& lights, uint64_t seed,
                                    uint64_t stream, uint64_t counter, std::span<float> radiance) const {
    const size_t nx = surface_.nx, n_channels = material_.channels.size();
    const auto u = static_cast<float>(places.place.u), v = static_cast<float>(places.place.v);
    Walk walk(surface_, material_, sky_, grid_, lights, nx * places.n_rows);
    std::vector<size_t> place_of;  // of the facets that face the view
    for (int row = 0; row < places.n_rows; ++row)
        for (int i = 0; i < surface_.nx; ++i) {
            const int j = places.first_row + row;
            const Gradient g = facet_gradient(surface_, places.place.kind, i, j);
            if (!(places.view.z > g.x * places.view.x + g.y * places.view.y)) continue;
            walk.see(places.place.kind, i, j, u, v, places.view);
            place_of.push_back(row * nx + i);
        }
    std::vector<double> found(place_of.size() * n_channels, 0.0);
    const BackwardTally tally = walk.run(
        max_order_, mean_sky_, has_density_, [&] { return random_words(seed, stream, counter++); }, found);
    std::fill(radiance.begin(), radiance.end(), 0.0f);
    for (size_t k = 0; k < place_of.size(); ++k)
        for (size_t c = 0; c < n_channels; ++c)
            radiance[c * nx * places.n_rows + place_of[k]] = static_cast<float>(found[k * n_channels + c]);
    return tally;
}

}  // namespace gonio
