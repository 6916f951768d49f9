// The light that every facet part sends back on a curved base, where it turns from facet to facet
// (turned_light.h); else as radiosity.h.
#pragma once
#include <array>
#include <vector>

#include "scattering/radiosity.h"
#include "scattering/turned_light.h"

namespace gonio {

struct TurnedRadiosity {
    std::vector<Fields> of_channel;  // as of Radiosity::of; every facet answers in its own frame
    int applications = 0;            // of either operator: the most so far
    double remainder = 0;            // as Radiosity::remainder: the largest so far
};

// operators: K and K', which take turns; K' is not looked at where max_order is 2. light: its coefficients
// are irradiances, not scaled by sqrt(area).
void turned_radiosity(const std::array<LinkOperator, 2>& operators, const Tile& tile,
                      const FacetAlbedo& albedo, const RadiosityOptions& options, const TurnedLight& light,
                      int n_threads, const Monitor& monitor, TurnedRadiosity& result);

}  // namespace gonio
