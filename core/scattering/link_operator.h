// The diffuse transport operator: who sees whom, sampled by dependent tests, and symmetrised.
#pragma once
#include <vector>

#include "base/monitor.h"
#include "directions/direction_set.h"
#include "scattering/fields.h"
#include "scattering/irradiance.h"
#include "scattering/kernels.h"
#include "scattering/tile.h"

namespace gonio {

// Which ray found a link.
struct LinkOrigin {
    int direction;  // of the set
    float travel;   // cells to what is seen
};

// K of the irradiance equation E = E_direct + albedo K E on facet parts of constant irradiance, in the basis
// scaled by sqrt(area), where exact transport is self-adjoint. The sampled one is, too: each line found
// between two facets counts both ways, weighed by the balance heuristic (link_operator.cpp), so tables are
// reciprocal to rounding whatever the number of directions.
struct LinkOperator {
    struct Chunk {
        std::vector<LinkRecord> records;  // one more than there are: its end
        std::vector<Link> links;
        std::vector<LinkTurn> turns;  // parallel to links on a curved base, else empty
        std::vector<LinkOrigin>
            origins;  // parallel to links where a flat base tells what is seen, else empty
    };
    std::vector<Chunk> chunks;
    double rays = 0, links = 0;
    double substituted =
        0;  // hits outside the tile that took the link of a neighbouring ray of the same direction
    double dropped = 0;  // hits outside the tile with no such neighbour
};

// jitter: one place inside the facets per direction. A tile of refinement r traces direction i from part i
// mod r^2 only, with r^2 times the weight: the angular quadrature needs the directions, the irradiance the
// parts.
LinkOperator build_link_operator(const MarchGrid& grid, const Tile& tile, const DirectionSet& set,
                                 const std::vector<SubSample>& jitter, int n_threads, const Monitor& monitor);

// y = K x.
void apply(const LinkOperator& op, const Fields& x, Fields& y, int n_threads);

}  // namespace gonio
