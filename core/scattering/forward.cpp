#include "scattering/forward.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/random.h"
#include "material/facet_brdf.h"
#include "scattering/lobe_points.h"
#include "surface/facet_mesh.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr size_t batch_rays = size_t{1}
                              << 14;  // followed together: their arrays stay in the second-level cache

}  // namespace

ForwardScene::ForwardScene(const HeightField& surface, const MarchGrid& march, const Material& material,
                           std::span<const ReceiverCell> cells, bool axes_swapped)
    : surface_(surface),
      march_(march),
      material_(material),
      grid_(make_trace_grid(surface)),
      locator_(cells),
      axes_swapped_(axes_swapped),
      n_cells_(cells.size()) {
    if (material.lobes.size() == 1 && !material.lobes[0].weight.is_map())
        if (const auto* mirror = std::get_if<Mirror>(&material.lobes[0].lobe);
            mirror && !mirror->reflectance.fresnel() && !mirror->reflectance.reflectance.is_map())
            for (size_t c = 0; c < material.channels.size(); ++c)
                mirror_.push_back(static_cast<float>(material.lobes[0].weight.at(c, 0, 0) *
                                                     mirror->reflectance.reflectance.at(c, 0, 0)));
    const size_t n = 2 * static_cast<size_t>(surface.nx) * surface.ny;
    for (std::vector<float>* field : {&normal_x_, &normal_y_, &normal_z_, &area_}) field->reserve(n);
    for (int kind = 0; kind < 2; ++kind)
        for (int j = 0; j < surface.ny; ++j)
            for (int i = 0; i < surface.nx; ++i) {
                const Gradient g = facet_gradient(surface, kind, i, j);
                const double ratio = area_ratio(g);
                normal_x_.push_back(static_cast<float>(-g.x / ratio));
                normal_y_.push_back(static_cast<float>(-g.y / ratio));
                normal_z_.push_back(static_cast<float>(1 / ratio));
                area_.push_back(static_cast<float>(0.5 * ratio));
            }
}

double ForwardScene::estimated_bytes(const HeightField& surface) {
    return 56.0 * surface.nx * surface.ny;  // corners, two maxima, four numbers for each of two facets
}

class LightTracer {
  public:
    LightTracer(const ForwardScene& scene, const Vec3& light, const ForwardSettings& settings, uint64_t seed,
                uint64_t stream, int light_number)
        : scene_(scene),
          light_(light),
          settings_(settings),
          n_channels_(scene.material_.channels.size()),
          seed_(seed),
          stream_(stream),
          counter_((static_cast<uint64_t>(light_number) + 1) << 40),
          points_(random_words(seed, stream, counter_++)) {
        const size_t row = static_cast<size_t>(scene.surface_.nx);
        for (RayBatch* batch : {&rays_, &hits_, &escaped_}) batch->reserve(batch_rays + row);
        weights_.resize((batch_rays + row) * n_channels_);
        factors_.resize(n_channels_);
        tally_.remainder.assign(n_channels_, 0.0);
        chosen_ = chosen_cells();
    }

    ForwardTally run(const Monitor& monitor) {
        for (const SubSample& place : settings_.sub_samples)
            for (int kind = 0; kind < 2; ++kind) {
                monitor.check_cancelled();
                start_rays(place, kind, monitor);
            }
        follow();
        normalise();
        return std::move(tally_);
    }

  private:
    size_t facet(int kind, int i, int j) const {
        return (static_cast<size_t>(kind) * scene_.surface_.ny + j) * scene_.surface_.nx + i;
    }
    Vec3 normal(size_t f) const { return {scene_.normal_x_[f], scene_.normal_y_[f], scene_.normal_z_[f]}; }

    std::vector<CellRect> chosen_cells() const;
    void start_rays(const SubSample& place, int kind, const Monitor& monitor);
    // Adds the ray that leaves a facet on which light along -wo falls; its weights are multiplied by what is
    // reflected.
    void reflect(int kind, int i, int j, float u, float v, float z, const Vec3& wo, int32_t id, double u_lobe,
                 double u1, double u2);
    void follow();
    void deposit(int order);
    void normalise();

    const ForwardScene& scene_;
    const Vec3 light_;
    const ForwardSettings& settings_;
    const size_t n_channels_;
    const uint64_t seed_, stream_;
    uint64_t counter_;
    LobePoints points_;
    double received_ = 0,
           expected_ = 0;  // projected area of the lit places; of all cells looked at, in truth
    std::vector<CellRect> chosen_;
    RayBatch rays_, hits_, escaped_;
    std::vector<int32_t> lost_;
    std::vector<float> weights_;   // [ray][channel]: flux
    std::vector<double> factors_;  // of one reflection
    std::vector<uint32_t> bits_;
    ForwardTally tally_;
};

std::vector<CellRect> LightTracer::chosen_cells() const {
    const HeightField& s = scene_.surface_;
    const CellRect all{s.border_x, s.border_y, s.nx - 2 * s.border_x, s.ny - 2 * s.border_y};
    if (settings_.block_step == 1) return {all};
    std::vector<CellRect> blocks;
    int number = settings_.first_block;
    for (int y = 0; y < all.height; y += march_block)
        for (int x = 0; x < all.width; x += march_block, ++number)
            if (number % settings_.block_step == 0)
                blocks.push_back({all.x0 + x, all.y0 + y, std::min(march_block, all.width - x),
                                  std::min(march_block, all.height - y)});
    return blocks;
}

void LightTracer::start_rays(const SubSample& place, int kind, const Monitor& monitor) {
    const FacetPoint point = facet_point(kind, place.a, place.b);
    const float u = static_cast<float>(point.u), v = static_cast<float>(point.v);
    const bool always_lit =
        settings_.skip_steep && light_.z > scene_.march_.max_slope * std::hypot(light_.x, light_.y);
    RayBundle bundle;
    if (!always_lit) {
        bundle = make_ray_bundle(scene_.march_, light_, point, max_march_travel);
        tally_.truncated_bundles += bundle.truncated;
    }
    for (const CellRect& rect : chosen_) {
        const size_t words = words_for(rect.width);
        bits_.assign(words * rect.height, ~0u);
        if (!always_lit) {
            march_visible(scene_.march_, bundle, rect, bits_.data());
            tally_.rays_marched += static_cast<double>(rect.width) * rect.height;
        }
        expected_ += 0.5 * rect.width * rect.height * light_.z;
        for (int row = 0; row < rect.height; ++row) {
            if (rays_.n + static_cast<size_t>(rect.width) > rays_.capacity()) {
                monitor.check_cancelled();
                follow();
            }
            for (size_t word = 0; word < words; ++word)
                for (uint32_t left = bits_[row * words + word]; left != 0; left &= left - 1) {
                    const int column = static_cast<int>(word) * march_block + std::countr_zero(left);
                    if (column >= rect.width) break;
                    const int i = rect.x0 + column, j = rect.y0 + row;
                    const size_t f = facet(kind, i, j);
                    const double cosine = dot(normal(f), light_);
                    if (!(cosine > 0)) continue;
                    const double flux = scene_.area_[f] * cosine;
                    received_ += flux;
                    const auto id = static_cast<int32_t>(rays_.n);
                    std::fill_n(&weights_[id * n_channels_], n_channels_, static_cast<float>(flux));
                    const auto dice = points_.next();
                    reflect(kind, i, j, u, v, facet_height(scene_.grid_, kind, i, j, u, v), light_, id,
                            dice[0], dice[1], dice[2]);
                }
        }
    }
}

void LightTracer::reflect(int kind, int i, int j, float u, float v, float z, const Vec3& wo, int32_t id,
                          double u_lobe, double u1, double u2) {
    float* weights = &weights_[id * n_channels_];
    if (!scene_.mirror_.empty()) {
        const Vec3 n = normal(facet(kind, i, j));
        const double twice = 2 * dot(n, wo);
        for (size_t c = 0; c < n_channels_; ++c) weights[c] *= scene_.mirror_[c];
        rays_.add(scene_.grid_, i, j, u, v, z, {twice * n.x - wo.x, twice * n.y - wo.y, twice * n.z - wo.z},
                  id);
        return;
    }
    const FacetBrdf brdf(scene_.material_, scene_.surface_, kind, i, j);
    const auto sample = brdf.sample(wo, u_lobe, u1, u2, factors_);
    if (!sample) return;  // absorbed
    for (size_t c = 0; c < n_channels_; ++c) weights[c] = static_cast<float>(weights[c] * factors_[c]);
    rays_.add(scene_.grid_, i, j, u, v, z, sample->wi, id);
}

void LightTracer::deposit(int order) {
    if (tally_.share.size() < static_cast<size_t>(order))
        tally_.share.emplace_back(n_channels_ * scene_.n_cells_, 0.0);
    std::vector<double>& share = tally_.share[order - 1];
    const double back = 1 / scene_.grid_.aspect;
    for (size_t k = 0; k < escaped_.n; ++k) {
        double x = escaped_.dx[k], y = escaped_.dy[k] * back;
        if (scene_.axes_swapped_) std::swap(x, y);
        const int cell = scene_.locator_(x, y);
        const float* weights = &weights_[escaped_.id[k] * n_channels_];
        for (size_t c = 0; c < n_channels_; ++c) share[c * scene_.n_cells_ + cell] += weights[c];
    }
}

// All rays of the batch to their ends.
void LightTracer::follow() {
    const auto leave = [&](int32_t id) {
        for (size_t c = 0; c < n_channels_; ++c) tally_.remainder[c] += weights_[id * n_channels_ + c];
    };
    const double back = 1 / scene_.grid_.aspect;
    for (int order = 1; rays_.n > 0; ++order) {
        tally_.rays += static_cast<double>(rays_.n);
        tally_.rays_lost += static_cast<double>(trace_rays(scene_.grid_, rays_, hits_, escaped_, lost_));
        deposit(order);
        for (const int32_t id : lost_) leave(id);
        if (order == settings_.max_order) break;
        if (order == most_forward_orders) {
            for (size_t k = 0; k < hits_.n; ++k) leave(hits_.id[k]);
            break;
        }
        for (size_t k = 0; k < hits_.n; ++k) {
            const Vec3 wo{-hits_.dx[k], -hits_.dy[k] * back, -hits_.dz[k]};
            const int kind = hits_.kind[k], i = hits_.i[k], j = hits_.j[k];
            if (!(dot(normal(facet(kind, i, j)), wo) > 0)) {
                // From behind, by rounding, at an edge: on as it came.
                rays_.add(scene_.grid_, i, j, hits_.u[k], hits_.v[k], hits_.z[k], {-wo.x, -wo.y, -wo.z},
                          hits_.id[k]);
                continue;
            }
            double u[3] = {};
            if (scene_.mirror_.empty()) {
                const auto words = random_words(seed_, stream_, counter_++);
                for (int n = 0; n < 3; ++n) u[n] = uniform_double(words[n]);
            }
            reflect(kind, i, j, hits_.u[k], hits_.v[k], hits_.z[k], wo, hits_.id[k], u[0], u[1], u[2]);
        }
    }
    rays_.n = 0;
}

void LightTracer::normalise() {
    const HeightField& s = scene_.surface_;
    const bool open = s.border_x > 0 || s.border_y > 0;
    tally_.projected = expected_ > 0 ? received_ / expected_ : 1;
    // Of a part of a surface the projected area is not A cos theta in truth: that is divided by the plain
    // area.
    const double whole = open ? expected_ : received_, scale = whole > 0 ? 1 / whole : 0.0;
    for (std::vector<double>& order : tally_.share)
        for (double& value : order) value *= scale;
    for (double& value : tally_.remainder) value *= scale;
}

ForwardTally trace_light(const ForwardScene& scene, const Vec3& light, const ForwardSettings& settings,
                         uint64_t seed, uint64_t stream, int light_number, const Monitor& monitor) {
    return LightTracer(scene, light, settings, seed, stream, light_number).run(monitor);
}

}  // namespace gonio
