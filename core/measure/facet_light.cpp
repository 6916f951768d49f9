#include "measure/facet_light.h"

#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "directions/direction_set.h"
#include "measure/run.h"
#include "visibility/march.h"

namespace gonio {
namespace {

Parameter channel_albedos(const Material& material) {
    const Lambertian* lambertian = pure_lambertian(material);
    if (!lambertian)
        throw Error(ErrorCode::invalid_input, "/material", "",
                    "pictures are measured of Lambertian facets so far");
    return lambertian->albedo.for_channels(material.channels.size());
}

ChannelFactors sqrt_albedos(const Tile& tile, const Parameter& albedo, size_t channel) {
    ChannelFactors factors(tile.n_slots(), 0.0f);
    for (int kind = 0; kind < 2; ++kind)
        for (int j = 0; j < tile.ny; ++j)
            for (int i = 0; i < tile.nx; ++i)
                factors[tile.slot(kind, j, i)] = static_cast<float>(std::sqrt(albedo.at(channel, i, j)));
    return factors;
}

}  // namespace

FacetLight::FacetLight(const HeightField& surface, const Material& material, int max_order,
                       const Accuracy::Samples& samples, uint64_t seed, const RunOptions& options,
                       const Monitor& monitor)
    : surface_(surface),
      albedo_(channel_albedos(material)),
      max_order_(max_order),
      samples_(samples),
      seed_(seed),
      options_(options),
      monitor_(monitor),
      grid_(make_march_grid(surface)) {
    if (surface.base.is_curved())
        throw Error(ErrorCode::invalid_input, "/base", "", "pictures are measured on a flat base so far");
    const CellRect all{0, 0, surface.nx, surface.ny};
    tile_ = make_tile(surface, all, all, samples.refinement);
    for (size_t c = 0; albedo_.is_map() && c < albedo_.n_channels(); ++c)
        maps_.push_back(sqrt_albedos(tile_, albedo_, c));
    indirect_ = max_order != 1 && grid_.max_slope > 0;
}

void FacetLight::start_run(int run) {
    const auto shift = [&](int which) {
        return uniform_double(random_words(seed_, static_cast<uint64_t>(run), which)[0]);
    };
    places_ = shifted_sub_samples(samples_.sub_samples, shift(2), shift(3));
    if (!indirect_) return;
    const double slope = grid_.max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    op_ = build_link_operator(grid_, tile_, slab_directions(samples_.directions, z_max, shift(4), shift(5)),
                              shifted_sub_samples(samples_.directions, shift(6), shift(7)),
                              options_.n_threads, monitor_);
    rays_ += op_.rays;
    links_ += op_.links;
}

LightIrradiance FacetLight::irradiance(const std::vector<Vec3>& lights) {
    LightIrradiance direct =
        light_irradiance(grid_, tile_, lights, places_, options_.allow_skips, options_.n_threads, monitor_);
    rays_ += direct.rays;
    truncated_ += direct.truncated_bundles;
    return direct;
}

Radiosity FacetLight::radiosity(const Fields& irradiance) {
    RadiosityOptions series;
    series.max_order = max_order_;
    Radiosity radiosity = diffuse_radiosity(indirect_ ? &op_ : nullptr, tile_, irradiance, albedo_.constant,
                                            maps_, series, options_.n_threads, monitor_);
    applications_ = std::max(applications_, radiosity.applications);
    remainder_ = std::max(remainder_, radiosity.remainder);
    return radiosity;
}

void FacetLight::describe(int runs, Report& report) const {
    report.settings = {{"transport", "diffuse operator"},
                       {"runs", std::to_string(runs)},
                       {"directions", std::to_string(samples_.directions)},
                       {"sub_samples", std::to_string(samples_.sub_samples)},
                       {"refinement", std::to_string(samples_.refinement)},
                       {"applications", std::to_string(applications_)},
                       {"simd", simd_target()}};
    report.counters = {{"rays", rays_}, {"links", links_}, {"truncated_bundles", truncated_}};
}

}  // namespace gonio
