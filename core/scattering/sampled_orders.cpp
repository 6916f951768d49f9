#include "scattering/sampled_orders.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "material/facet_brdf.h"
#include "scattering/lobe_points.h"
#include "scattering/ray_hits.h"
#include "visibility/crossings.h"

namespace gonio {
namespace {

constexpr size_t batch_rays = size_t{1} << 13;  // followed together: they stay in the second-level cache
constexpr size_t hits_together = 128;           // whose lobes are looked up together

// Of one light: [channel][order - first][view], and what became of its rays.
struct LightOrders {
    std::vector<std::vector<std::vector<double>>> rows;
    std::vector<double> flux;  // that arrives as order k + 1 on facets: [k], of channel 0
    double left = 0, rays = 0, rays_lost = 0;
};

class LobeTracer {
  public:
    LobeTracer(const SampledScene& scene, const GraphSide& lights, const GraphSide& views,
               const SamplingOptions& options, int light, const Monitor& monitor)
        : scene_(scene),
          lights_(lights),
          views_(views),
          options_(options),
          monitor_(monitor),
          light_(light),
          n_channels_(scene.channels.size()),
          core_area_(core_areas(scene.tile)),
          counter_((static_cast<uint64_t>(options.light_numbers[light]) + 1) << 40 | options.tile_number
                                                                                         << 30),
          points_(words()) {
        for (RayBatch* batch : {&rays_, &hits_, &escaped_}) batch->reserve(batch_rays);
        weights_.resize(batch_rays * n_channels_);
        factors_.resize(scene.material.channels.size());
        found_.rows.resize(n_channels_);
    }

    LightOrders run() {
        start_rays();
        follow();
        return std::move(found_);
    }

  private:
    std::array<uint32_t, 4> words() { return random_words(options_.seed, options_.stream, counter_++); }
    double flux_onto(size_t unknown) const {
        const double root = scene_.tile.sqrt_area[unknown % scene_.tile.n_slots()];
        return root * root * lights_.visible->of(unknown)[light_];
    }

    // Systematic sampling: walking over the lit parts, a ray each time so much flux more has been passed.
    void start_rays() {
        const Tile& tile = scene_.tile;
        double all = 0;
        for (size_t u = 0; u < tile.n_unknowns(); ++u) all += flux_onto(u);
        if (!(all > 0)) return;
        const double facets = 2.0 * tile.area.width * tile.area.height,
                     each = all / std::ceil(options_.rays_per_facet * facets);
        found_.flux.assign(1, all);
        const Vec3 light{lights_.directions.x[light_], lights_.directions.y[light_],
                         lights_.directions.z[light_]};
        double next = uniform_double(words()[0]) * each, passed = 0;
        for (size_t u = 0; u < tile.n_unknowns(); ++u) {
            for (passed += flux_onto(u); next < passed; next += each) {
                if (rays_.n == batch_rays) follow();
                const size_t slot = u % tile.n_slots();
                const int kind = slot >= tile.n_slots() / 2, part = static_cast<int>(u / tile.n_slots()),
                          cell = static_cast<int>(slot % (tile.n_slots() / 2)), row = cell / tile.stride,
                          column = cell % tile.stride, i = into_period(tile.area.x0 + column, tile.nx),
                          j = into_period(tile.area.y0 + row, tile.ny);
                const auto place = words();
                const FacetPoint point = facet_point(kind, uniform_double(place[0]), uniform_double(place[1]),
                                                     tile.refinement, part);
                const float x = static_cast<float>(point.u), y = static_cast<float>(point.v);
                const auto id = static_cast<int32_t>(rays_.n);
                std::fill_n(&weights_[id * n_channels_], n_channels_, static_cast<float>(each));
                reflect(kind, i, j, x, y, facet_height(scene_.grid, kind, i, j, x, y), light, id,
                        points_.next());
            }
        }
    }

    // Adds the ray that leaves a facet on which light along -wo falls.
    void reflect(int kind, int i, int j, float u, float v, float z, const Vec3& wo, int32_t id,
                 const std::array<double, 3>& dice) {
        const FacetBrdf brdf(scene_.material, scene_.surface, kind, i, j);
        const auto sample = brdf.sample(wo, dice[0], dice[1], dice[2], factors_);
        if (!sample) return;  // absorbed
        float* weights = &weights_[id * n_channels_];
        for (size_t c = 0; c < n_channels_; ++c)
            weights[c] = static_cast<float>(weights[c] * factors_[scene_.channels[c]]);
        rays_.add(scene_.grid, i, j, u, v, z, sample->wi, id);
    }

    // All rays of the batch to their ends.
    void follow() {
        monitor_.check_cancelled();
        const double back = 1 / scene_.grid.aspect;
        const int most = options_.max_order > 0 ? options_.max_order : most_sampled_orders;
        for (int order = 2; rays_.n > 0; ++order) {
            found_.rays += static_cast<double>(rays_.n);
            found_.rays_lost += static_cast<double>(trace_rays(scene_.grid, rays_, hits_, escaped_, lost_));
            if (order >= options_.first_order) count_views(order);
            for (size_t k = 0; k < hits_.n; ++k) {
                const float flux = weights_[hits_.id[k] * n_channels_];
                if (found_.flux.size() < static_cast<size_t>(order)) found_.flux.resize(order, 0.0);
                found_.flux[order - 1] += flux;
                if (order == most && options_.max_order == 0) found_.left += flux;
            }
            if (order == most) break;
            for (size_t k = 0; k < hits_.n; ++k) {
                const Vec3 wo = backwards(k, back);
                const int kind = hits_.kind[k], i = hits_.i[k], j = hits_.j[k];
                const auto dice = words();
                if (faces(kind, i, j, wo))
                    reflect(kind, i, j, hits_.u[k], hits_.v[k], hits_.z[k], wo, hits_.id[k],
                            {uniform_double(dice[0]), uniform_double(dice[1]), uniform_double(dice[2])});
                else  // from behind, by rounding, at an edge: on as it came
                    rays_.add(scene_.grid, i, j, hits_.u[k], hits_.v[k], hits_.z[k], {-wo.x, -wo.y, -wo.z},
                              hits_.id[k]);
            }
        }
        rays_.n = 0;
    }

    Vec3 backwards(size_t hit, double back) const {
        return {-hits_.dx[hit], -hits_.dy[hit] * back, -hits_.dz[hit]};
    }
    bool faces(int kind, int i, int j, const Vec3& wo) const {
        const Gradient g = facet_gradient(scene_.surface, kind, i, j);
        return wo.z - g.x * wo.x - g.y * wo.y > 0;
    }

    // What the facets that were hit send to the views.
    void count_views(int order) {
        const Tile& tile = scene_.tile;
        const double back = 1 / scene_.grid.aspect;
        slots_.clear();
        unknowns_.clear();
        ids_.clear();
        for (auto* axis : {&x_, &y_, &z_}) axis->clear();
        for (size_t k = 0; k < hits_.n; ++k) {
            int column, row;
            const int kind = hits_.kind[k];
            if (!hit_cell(tile, hits_.i[k] - tile.area.x0, hits_.j[k] - tile.area.y0, column, row)) continue;
            const size_t slot = tile.slot(kind, row, column);
            const Vec3 wo = backwards(k, back);
            if (core_area_[slot] == 0 || !faces(kind, hits_.i[k], hits_.j[k], wo)) continue;
            const int part = facet_part(kind, hits_.u[k], hits_.v[k], tile.refinement);
            slots_.push_back(static_cast<uint32_t>(slot));
            unknowns_.push_back(part * tile.n_slots() + slot);
            ids_.push_back(hits_.id[k]);
            x_.push_back(static_cast<float>(wo.x));
            y_.push_back(static_cast<float>(wo.y));
            z_.push_back(static_cast<float>(wo.z));
        }
        const size_t at = options_.keep_orders ? order - options_.first_order : 0,
                     columns = views_.directions.x.size();
        f_.resize(hits_together * columns);
        for (size_t c = 0; c < n_channels_; ++c) {
            auto& rows = found_.rows[c];
            while (rows.size() <= at) rows.emplace_back(columns, 0.0);
            for (size_t first = 0; first < slots_.size(); first += hits_together) {
                const size_t n = std::min(hits_together, slots_.size() - first);
                lobe_rows(scene_.materials[c], tile, n, &slots_[first], &x_[first], &y_[first], &z_[first],
                          views_.directions, f_.data());
                sums_.assign(columns, 0.0f);
                for (size_t k = 0; k < n; ++k) {
                    const float weight = weights_[ids_[first + k] * n_channels_ + c];
                    const float *f = &f_[k * columns], *seen = views_.visible->of(unknowns_[first + k]);
                    for (size_t v = 0; v < columns; ++v) sums_[v] += weight * f[v] * seen[v];
                }
                for (size_t v = 0; v < columns; ++v) rows[at][v] += sums_[v];
            }
        }
    }

    const SampledScene& scene_;
    const GraphSide &lights_, &views_;
    const SamplingOptions& options_;
    const Monitor& monitor_;
    const int light_;
    const size_t n_channels_;
    const std::vector<float> core_area_;
    uint64_t counter_;
    LobePoints points_;
    RayBatch rays_, hits_, escaped_;
    std::vector<int32_t> lost_;
    std::vector<float> weights_;   // [ray][channel]: flux
    std::vector<double> factors_;  // of one reflection, all channels of the material
    // Of the hits that are counted.
    std::vector<uint32_t> slots_;
    std::vector<size_t> unknowns_;
    std::vector<int32_t> ids_;
    std::vector<float> x_, y_, z_, f_, sums_;
    LightOrders found_;
};

}  // namespace

SampledOrders sample_orders(const SampledScene& scene, const GraphSide& lights, const GraphSide& views,
                            const SamplingOptions& options, int n_threads, const Monitor& monitor) {
    const int n_lights = lights.directions.n;
    std::vector<LightOrders> found(n_lights);
    parallel_for(n_lights, n_threads, [&](int light) {
        found[light] = LobeTracer(scene, lights, views, options, light, monitor).run();
    });
    SampledOrders result;
    result.orders.resize(scene.channels.size());
    for (int light = 0; light < n_lights; ++light) {
        const LightOrders& of = found[light];
        for (size_t c = 0; c < of.rows.size(); ++c)
            for (size_t k = 0; k < of.rows[c].size(); ++k) {
                auto& orders = result.orders[c];
                if (orders.size() <= k) orders.resize(k + 1, Matrix(n_lights, views.directions.n));
                for (int v = 0; v < views.directions.n; ++v) orders[k](light, v) = of.rows[c][k][v];
            }
        result.rays += of.rays;
        result.rays_lost += of.rays_lost;
        if (of.flux.empty()) continue;
        result.remainder = std::max(result.remainder, of.left / of.flux[0]);
        for (size_t k = 1; k < of.flux.size(); ++k)
            if (of.flux[k] > options.tolerance * of.flux[0])
                result.n_orders = std::max(result.n_orders, static_cast<int>(k));
    }
    return result;
}

}  // namespace gonio
