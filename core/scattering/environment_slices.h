// Irradiance from an environment by horizon slices (Timonen, Westerholm 2010 [1], sec. 6): the sky of a
// receiver is a sum over azimuths of tables that are integrated over the zenith angle down to the horizon.
//
// [1] averages light over each slice and integrates its azimuth, too (the sine in eq. 5): that is a filter,
// and at 16 azimuths it takes 0.6 % off whatever depends on the azimuth. Here light is cut to the harmonics
// of the azimuth that n slices can tell apart (below n / 2), and everything else is taken at the middle
// azimuth alone: exact for light of those harmonics wherever the horizon is smooth. Small bright sources are
// not made of few harmonics; they are taken out and shone as directions (key_lights).
#pragma once
#include <cstdint>

#include "base/monitor.h"
#include "scattering/environment.h"
#include "scattering/irradiance.h"
#include "visibility/horizon_map.h"

namespace gonio {

// What the sky above a horizon gives, for one azimuth: integrals of <n, e> L over the zenith angle as tables
// over u = sin(elevation of the horizon).
class SkySlice {
  public:
    // radiance: [channel][row] of an equirectangular map, towards this azimuth; weight: of the slice,
    // radians.
    SkySlice(const std::vector<double>& radiance, int n_channels, int map_ny, double azimuth, double weight);
    // Adds the irradiance of a facet with that unit normal and horizon, [channel].
    void add(double horizon_slope, const Vec3& normal, double* irradiance) const;

  private:
    int n_channels_;
    double cos_azimuth_, sin_azimuth_;
    std::vector<float> table_;  // [step][channel][along z, across]
};

// Slices of equal weight, one an azimuth; the azimuths are evenly spread.
std::vector<SkySlice> sky_slices(const Environment& environment, const std::vector<double>& azimuths);

// A texel that is shone as a direction: irradiance[channel] on a plane that faces it.
struct KeyLight {
    int row = 0, column = 0;
    std::vector<double> irradiance;
};
struct SplitEnvironment {
    Environment sky;  // without the key lights
    std::vector<KeyLight> key_lights;
};
// At most 64 texels above the horizon that each give more than a 1/500 of a plane's irradiance from less than
// 3 degrees.
SplitEnvironment split_key_lights(const Environment& environment);
// A place inside the texel, uniform in solid angle; u, v in [0, 1).
Vec3 direction_of(const Environment& environment, const KeyLight& light, double u, double v);

struct SliceOptions {
    int azimuths = 16;
    double shift = 0.5;  // of the azimuths, in slices
    HorizonOptions horizon;
};

// sqrt(area) E, [unknown][channel]: irradiance of every facet part from the sky, at one place inside each.
Fields sky_irradiance(const MarchGrid& grid, const Tile& tile, const Environment& sky, const SubSample& place,
                      const SliceOptions& options, int n_threads, const Monitor& monitor);

}  // namespace gonio
