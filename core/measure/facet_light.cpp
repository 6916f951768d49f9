#include "measure/facet_light.h"

#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "directions/direction_set.h"
#include "measure/run.h"
#include "visibility/curvature.h"
#include "visibility/march.h"

namespace gonio {
namespace {

FacetAlbedo facet_albedo(const HeightField& surface, const Material& material, const Tile& tile) {
    const Lambertian* lambertian = pure_lambertian(material);
    if (!lambertian)
        throw Error(ErrorCode::invalid_input, "/material", "",
                    "needs Lambertian facets: what others send back depends on the view");
    const Parameter albedo = lambertian->albedo.for_channels(material.channels.size());
    FacetAlbedo facets;
    if (!albedo.is_map()) {
        facets.constant = albedo.constant;
        return facets;
    }
    for (size_t c = 0; c < albedo.n_channels(); ++c) {
        std::vector<float>& map = facets.maps.emplace_back(tile.n_slots(), 0.0f);
        for (int kind = 0; kind < 2; ++kind)
            for (int j = 0; j < surface.ny; ++j)
                for (int i = 0; i < surface.nx; ++i)
                    map[tile.slot(kind, j, i)] = static_cast<float>(albedo.at(c, i, j));
    }
    return facets;
}

Tile whole_period(const HeightField& surface, int refinement) {
    check_base(surface);
    const CellRect all{0, 0, surface.nx, surface.ny};
    return make_tile(surface, all, all, refinement);
}

Tile with_areas_of_1(Tile tile) {
    tile.sqrt_area.assign(tile.n_slots(), 1.0f);
    return tile;
}

RadiosityOptions series(int max_order) {
    RadiosityOptions options;
    options.max_order = max_order;
    return options;
}

}  // namespace

FacetLight::FacetLight(const HeightField& surface, const Material& material, int max_order,
                       const Accuracy::Samples& samples, uint64_t seed, const RunOptions& options,
                       const Monitor& monitor)
    : surface_(surface),
      samples_(samples),
      seed_(seed),
      options_(options),
      monitor_(monitor),
      grid_(make_march_grid(surface)),
      tile_(whole_period(surface, samples.refinement)),
      unit_tile_(with_areas_of_1(tile_)),
      radiosity_(tile_, facet_albedo(surface, material, tile_), series(max_order), options.n_threads,
                 monitor),
      indirect_(max_order != 1 && grid_.max_slope > 0),
      twice_(max_order == 0 || max_order > 2) {}

void FacetLight::start_run(int run) {
    const auto shift = [&](int which) {
        return uniform_double(random_words(seed_, static_cast<uint64_t>(run), which)[0]);
    };
    places_ = shifted_sub_samples(samples_.sub_samples, shift(2), shift(3));
    if (!indirect_) return;
    const double slope = grid_.max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    const auto sampled = [&](int directions, int first_shift) {
        LinkOperator op = build_link_operator(
            grid_, tile_, slab_directions(directions, z_max, shift(first_shift), shift(first_shift + 1)),
            shifted_sub_samples(directions, shift(first_shift + 2), shift(first_shift + 3)),
            options_.n_threads, monitor_);
        rays_ += op.rays;
        links_ += op.links;
        return op;
    };
    // A quarter of the directions adds little noise: orders 3 and up are a small part of the light.
    const int fewer = std::max({samples_.directions / 4, 8, tile_.n_parts()});
    LinkOperator first = sampled(samples_.directions, 4),
                 second = twice_ ? sampled(fewer, 8) : LinkOperator();
    if (surface_.base.is_curved())
        turning_ = {std::move(first), std::move(second)};
    else
        radiosity_.set_operators(
            {gather_operator(first, tile_), twice_ ? gather_operator(second, tile_) : GatherOperator()});
}

const std::vector<Fields>& FacetLight::radiosity(const std::vector<Vec3>& lights, const Fields& irradiance) {
    if (!indirect_ || !surface_.base.is_curved()) return radiosity_.of(irradiance);
    TurnedLight light = turned_light(grid_, unit_tile_, lights, irradiance, turn_step(rms_turn(turning_[0])), places_,
                                     options_.allow_skips, options_.n_threads, monitor_);
    rays_ += light.rays;
    turned_radiosity(turning_, tile_, radiosity_.albedo(), radiosity_.options(), light, options_.n_threads,
                     monitor_, turned_);
    return turned_.of_channel;
}

LightIrradiance FacetLight::irradiance(const std::vector<Vec3>& lights) {
    LightIrradiance direct = light_irradiance(grid_, unit_tile_, lights, places_, options_.allow_skips,
                                              options_.n_threads, monitor_);
    rays_ += direct.rays;
    truncated_ += direct.truncated_bundles;
    return direct;
}

void FacetLight::describe(int runs, Report& report) const {
    report.settings = {
        {"transport", "diffuse operator"},
        {"runs", std::to_string(runs)},
        {"directions", std::to_string(samples_.directions)},
        {"sub_samples", std::to_string(samples_.sub_samples)},
        {"refinement", std::to_string(samples_.refinement)},
        {"applications", std::to_string(std::max(radiosity_.applications(), turned_.applications))},
        {"simd", simd_target()}};
    report.counters = {{"rays", rays_}, {"links", links_}, {"truncated_bundles", truncated_}};
}

}  // namespace gonio
