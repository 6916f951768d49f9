// What an environment gives the facets of a relief in one random run: the sky by horizon slices, bright
// texels as directions. Internal to measure/.
#pragma once
#include "measure/facet_light.h"
#include "scattering/environment_slices.h"

namespace gonio {

inline float& value(Fields& fields, size_t unknown, int column) {
    return fields.block(column / column_block)[unknown * column_block + column % column_block];
}
inline float value(const Fields& fields, size_t unknown, int column) {
    return fields.block(column / column_block)[unknown * column_block + column % column_block];
}

// The channels of an environment that a material of n_channels needs. Throws Error: for RGB light on a
// spectrum; for curved bases.
Environment sky_on_flat_base(const HeightField& surface, int n_channels, const Environment& environment);

class SkyLight {
  public:
    // azimuths: of the horizon slices. The references must outlive it. Throws Error: for RGB light on a
    // spectrum; for curved bases.
    SkyLight(const HeightField& surface, const Environment& environment, int n_channels, int azimuths,
             uint64_t seed, const RunOptions& options, const Monitor& monitor);

    // Irradiance at one place inside each facet part, [unknown][channel]. The run is that which `light` has
    // started.
    Fields irradiance(const FacetLight& light, int run, const SubSample& place) const;
    // The same, averaged over the places of the run.
    Fields irradiance(const FacetLight& light, int run) const;

    size_t n_key_lights() const { return split_.key_lights.size(); }

  private:
    double shift(int run, uint64_t which) const;

    int azimuths_;
    uint64_t seed_;
    const RunOptions& options_;
    const Monitor& monitor_;
    SplitEnvironment split_;
};

}  // namespace gonio
