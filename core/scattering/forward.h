// Forward tracing: light is followed from the facets that it strikes, facet after facet, into receiver cells.
// For mirrors and narrow lobes, which see too little of the world for connections between given directions
// (shared/performance_glossy B). Whose flux arrives where is counted, order by order: all of what a light
// brings is deposited, absorbed or reported as left over.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "base/monitor.h"
#include "directions/cells.h"
#include "material/material.h"
#include "scattering/irradiance.h"
#include "surface/height_field.h"
#include "visibility/grid_tracer.h"
#include "visibility/march_grid.h"

namespace gonio {

// What all lights share. The referred ones must outlive it.
class ForwardScene {
  public:
    // cells: as CellLocator wants them; with x and y exchanged if axes_swapped. Throws Error(limit) for more
    // than 2^28 surface cells.
    ForwardScene(const HeightField& surface, const MarchGrid& march, const Material& material,
                 std::span<const ReceiverCell> cells, bool axes_swapped = false);

    static double estimated_bytes(const HeightField& surface);

  private:
    friend class LightTracer;
    const HeightField& surface_;
    const MarchGrid& march_;
    const Material& material_;
    // The reflectance of each channel if all facets are one mirror that reflects alike at all angles; else
    // empty.
    std::vector<float> mirror_;
    TraceGrid grid_;
    CellLocator locator_;
    bool axes_swapped_;
    size_t n_cells_;
    std::vector<float> normal_x_, normal_y_, normal_z_,
        area_;  // [kind][row][column]; area in pitch_x pitch_y
};

struct ForwardSettings {
    std::vector<SubSample> sub_samples;  // places inside the facets, from each of which a ray starts
    // Of the blocks of 32 x 32 cells, numbered row by row, only first_block + k block_step: a large surface's
    // light need not be followed from every facet. 1: all.
    int block_step = 1, first_block = 0;
    int max_order = 0;       // 0: all, that is most_forward_orders
    bool skip_steep = true;  // do not march for shadows where no facet is as steep as the light
};
inline constexpr int most_forward_orders = 64;

struct ForwardTally {
    // Share of the light's flux onto the surface that leaves into each cell: [order - 1][channel][cell].
    std::vector<std::vector<double>> share;
    // Share that was still on its way after the last of all orders, or given up, by channel. What a limit on
    // the orders leaves out is no remainder.
    std::vector<double> remainder;
    // Sampled over true projected area (1 in truth for a whole period).
    double projected = 1;
    double rays = 0, rays_lost = 0, rays_marched = 0;
    int truncated_bundles = 0;
};

// (seed, stream, light) key the random numbers. The same bits on any machine with the same instruction set.
ForwardTally trace_light(const ForwardScene& scene, const Vec3& light, const ForwardSettings& settings,
                         uint64_t seed, uint64_t stream, int light_number, const Monitor& monitor);

}  // namespace gonio
