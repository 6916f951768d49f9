#include "measure/sky_light.h"

#include "base/error.h"
#include "base/random.h"

namespace gonio {

Environment sky_on_flat_base(const HeightField& surface, int n_channels, const Environment& environment) {
    if (surface.base.is_curved())
        throw Error(ErrorCode::invalid_input, "/base", "",
                    "an environment lights flat bases only; a BRDF, BTF or maps know curved ones");
    return for_channels(environment, n_channels);
}

SkyLight::SkyLight(const HeightField& surface, const Environment& environment, int n_channels, int azimuths,
                   uint64_t seed, const RunOptions& options, const Monitor& monitor)
    : azimuths_(azimuths),
      seed_(seed),
      options_(options),
      monitor_(monitor),
      split_(split_key_lights(sky_on_flat_base(surface, n_channels, environment))) {}

double SkyLight::shift(int run, uint64_t which) const {
    constexpr uint64_t stream = uint64_t{1} << 32;  // FacetLight's runs use the streams below
    return uniform_double(random_words(seed_, stream + run, which)[0]);
}

Fields SkyLight::irradiance(const FacetLight& light, int run, const SubSample& place) const {
    SliceOptions slices;
    slices.azimuths = azimuths_;
    slices.shift = shift(run, 0);
    Fields sum = sky_irradiance(light.grid(), light.unit_tile(), split_.sky, place, slices,
                                options_.n_threads, monitor_);
    std::vector<Vec3> directions;
    for (const KeyLight& key : split_.key_lights) {
        const uint64_t k = directions.size();
        directions.push_back(direction_of(split_.sky, key, shift(run, 1 + 2 * k), shift(run, 2 + 2 * k)));
    }
    if (directions.empty()) return sum;
    const LightIrradiance keys = light_irradiance(light.grid(), light.unit_tile(), directions, {place},
                                                  options_.allow_skips, options_.n_threads, monitor_);
    for (size_t u = 0; u < sum.n_unknowns(); ++u)
        for (size_t k = 0; k < directions.size(); ++k) {
            const float lit = value(keys.lights, u, static_cast<int>(k));
            if (lit == 0) continue;
            for (int c = 0; c < sum.n_columns(); ++c)
                value(sum, u, c) += lit * static_cast<float>(split_.key_lights[k].irradiance[c]);
        }
    return sum;
}

Fields SkyLight::irradiance(const FacetLight& light, int run) const {
    Fields mean;
    const float share = 1.0f / static_cast<float>(light.places().size());
    for (const SubSample& place : light.places()) {
        Fields here = irradiance(light, run, place);
        for (float& value : here.values()) value *= share;
        if (mean.values().empty())
            mean = std::move(here);
        else
            for (size_t k = 0; k < here.values().size(); ++k) mean.values()[k] += here.values()[k];
    }
    return mean;
}

}  // namespace gonio
