// Backward tracing: what a viewer sees of a place on a facet under an environment, followed from the view
// along reflections until these miss the surface (Heidrich et al. 2000, fig. 10). For mirrors, which see the
// world in one direction alone that no shared one meets; what has a density beside them is lit by directions
// drawn from those of the environment, and reflects on along one direction of its own. Unbiased; of pure
// mirrors nothing is random but the places.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "material/material.h"
#include "scattering/environment.h"
#include "surface/height_field.h"
#include "visibility/crossings.h"
#include "visibility/grid_tracer.h"

namespace gonio {

inline constexpr int most_backward_orders = 64;

// The same place of all facets of one kind in some rows, seen from one direction.
struct SeenPlaces {
    FacetPoint place;
    int first_row = 0, n_rows = 0;
    Vec3 view;
};

struct BackwardTally {
    double rays = 0, rays_lost = 0;
    double left = 0;  // sum over the places of what was still on its way after the last of all orders, or
                      // given up, if it had met the sky's mean radiance; mean over the channels
    double seen = 0;  // the same sum of what was found
};

class BackwardTracer {
  public:
    // sky: of as many channels as the material. The references must outlive it. Throws Error(limit) for more
    // than 2^28 cells.
    BackwardTracer(const HeightField& surface, const Material& material, const Environment& sky,
                   int max_order);  // 0: all, that is most_backward_orders

    bool has_density() const { return has_density_; }

    // radiance[(channel * n_rows + row) * nx + column], 0 where a facet faces away. lights: of
    // sample_environment, for what has a density. (seed, stream, counter and 2^32 on) key the random numbers.
    // Thread-safe.
    BackwardTally trace(const SeenPlaces& places, const EnvironmentSamples& lights, uint64_t seed,
                        uint64_t stream, uint64_t counter, std::span<float> radiance) const;

    static double estimated_bytes(const HeightField& surface);

  private:
    const HeightField& surface_;
    const Material& material_;
    const Environment& sky_;
    int max_order_;
    bool has_density_;
    double mean_sky_;  // radiance
    TraceGrid grid_;
};

}  // namespace gonio
