// Direct light: visibility bits from the march, turned into irradiance factors, and the direct term as one
// matrix product.
#pragma once
#include <vector>

#include "base/monitor.h"
#include "scattering/fields.h"
#include "scattering/tile.h"

namespace gonio {

// One place inside every facet part, shared by all facets: what lets rays march in lockstep. a, b in [0, 1).
struct SubSample {
    double a = 0, b = 0;
};

// Facet factors sqrt(albedo) of one channel, one per slot of the tile; empty for a constant albedo (kept out
// of the transport).
using ChannelFactors = std::vector<float>;

struct Irradiance {
    // sqrt(area) max(0, <n, d>) V, averaged over the sub-samples: what the transport starts from. [light],
    // and [view] where they differ.
    Fields lights, views;
    bool same_directions = false;  // views are the lights: `views` is empty
    // direct[channel] (lights x views): sum over core and sub-samples of area <n,l>+ <n,v>+ V_l V_v (albedo).
    // The product is formed per sub-sample: averaged visibilities would miss that shadowing and masking are
    // correlated inside a facet. One channel for a constant albedo.
    std::vector<Matrix> direct;
    // Sum over the core of area <n,d>+ V: exactly core_area * cos_theta for a whole period.
    std::vector<double> projected_lights, projected_views;
    double rays = 0;            // facets times directions that were marched
    double rays_skipped = 0;    // of directions steeper than every facet
    int truncated_bundles = 0;  // nearly horizontal bundles given up before they had left the relief

    const Fields& view_fields() const { return same_directions ? lights : views; }
};

// channels: see ChannelFactors; {} or one entry a channel of an albedo map.
// skip_steep: answer directions above the steepest slope without marching.
Irradiance compute_irradiance(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                              const std::vector<Vec3>& views, bool same_directions,
                              const std::vector<SubSample>& sub_samples,
                              const std::vector<ChannelFactors>& channels, bool skip_steep, int n_threads,
                              const Monitor& monitor);

// The irradiance factors of the lights alone, where no product with views is wanted: sqrt(area) max(0, <n,
// d>) V, averaged over the sub-samples.
struct LightIrradiance {
    Fields lights;
    double rays = 0, rays_skipped = 0;
    int truncated_bundles = 0;
};
LightIrradiance light_irradiance(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                                 const std::vector<SubSample>& sub_samples, bool skip_steep, int n_threads,
                                 const Monitor& monitor);

// fields[u][c] *= factors[slot of u], for every part.
void scale_rows(Fields& fields, const Tile& tile, const ChannelFactors& factors, int n_threads);

// Cells of travel after which a nearly horizontal ray is given up.
inline constexpr double max_march_travel = 16384;

}  // namespace gonio
