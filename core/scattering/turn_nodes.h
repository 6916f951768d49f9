// Light on a curved base for facets of any material. As in turned_light.h what a facet gets is a polynomial
// of second degree in the turn t of the light, and carried on along a pair by shifting t. Here it is kept by
// its values at a few nodes instead of by coefficients: these belong to lights that are turned, like any
// others to visibility and lobes.
#pragma once
#include <array>
#include <vector>

#include "directions/direction.h"
#include "scattering/kernels.h"
#include "scattering/lobe_kernels.h"
#include "scattering/visibility_bits.h"
#include "surface/base_curvature.h"

namespace gonio {

class TurnNodes {
  public:
    static constexpr int most = 6;

    // Nodes at 0 and +-step of a base that is curved along one principal direction; else at 0 and the corners
    // of a regular pentagon, which with its middle lies on no conic. step: radians, above 0.
    TurnNodes(const BaseCurvature& base, double step);

    int count() const { return static_cast<int>(nodes_.size()); }
    // Radians towards the principal directions of the base; node 0 is at 0.
    const std::vector<std::array<double, 2>>& turns() const { return nodes_; }
    // [node][light]
    std::vector<Vec3> turned(const std::vector<Vec3>& lights) const;
    // Values of the nodes as the start of a pair tells them, from what its end does. rows: [node][n], in
    // place; scratch of that size.
    void shift(const LinkTurn& turn, size_t n, float* rows, float* scratch) const;

  private:
    // How much each node counts in the value at t.
    std::array<double, most> weights(double t0, double t1) const;

    BaseCurvature base_;
    double step_;
    bool both_;  // principal directions are curved
    std::vector<std::array<double, 2>> nodes_;
};

// Lights turned by every node, and what the facets of a tile see of them.
struct TurnedLights {
    DirectionArrays directions;  // TurnNodes::turned
    VisibleCosines visible;
    double rays = 0;
};
TurnedLights turned_lights(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                           const TurnNodes& nodes, const std::vector<SubSample>& sub_samples, bool skip_steep,
                           int n_threads, const Monitor& monitor);

}  // namespace gonio
