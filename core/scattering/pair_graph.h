// Orders of scattering 2 and up between glossy facets: chains of dependent tests (Heidrich et al. 2000, fig.
// 4) as discrete ordinates on the pairs (facet, shared direction) that hit something.
//
// State: R_k[e][l], the radiance of order k that arrives at facet p along direction d_i from the facet q it
// sees there (pair e), for light l. R_1[e] = f(n_q; l, -d_i) g_l(q); R_{k+1}[e] = sum over the pairs e' =
// (q, d_j) that start at q of omega <n_q, d_j> f(n_q; d_j, -d_i) R_k[e']. The view v receives sum over e of
// area_p omega <n_p, d_i> f(n_p; d_i, v) g_v(p) R_k[e] as order k + 1.
//
// On a curved base every facet tells directions in its own frame: a pair arrives at q along another direction
// than it leaves p, and a light that is fixed in space is another one at q. R_k[e] is then kept for lights
// turned by the nodes of turn_nodes.h, as p tells them, and shifted by the turn of every pair on the way.
#pragma once
#include <vector>

#include "base/monitor.h"
#include "directions/direction_set.h"
#include "scattering/fields.h"
#include "scattering/lobe_kernels.h"
#include "scattering/turn_nodes.h"
#include "scattering/visibility_bits.h"

namespace gonio {

// A direction as the kernels take it.
struct PairDirection {
    float x, y, z;
};
// On a curved base.
struct PairBend {
    PairDirection leaving, arriving;  // from the start to what it sees: in the frame of the start, and there
    LinkTurn turn;                    // of the frame on the way
    float growth;                     // of the solid angle, where directions are moved (moved_directions.h)
};

struct PairGraph {
    std::vector<uint32_t> start, seen, direction;  // per pair, grouped by `start`
    std::vector<uint32_t> out;           // n_unknowns + 1: the pairs that start at u are out[u] .. out[u + 1]
    std::vector<uint32_t> in, arriving;  // the pairs that see u are arriving[in[u] .. in[u + 1]]
    DirectionArrays directions;
    std::vector<PairBend> bends;  // per pair on a curved base, else empty
    double solid_angle = 0;       // that one pair stands for, but for its growth
    double rays = 0;
    double substituted = 0;  // hits outside the tile: the neighbouring ray's hit taken instead
    double dropped = 0;      // hits outside the tile with no such neighbour

    size_t size() const { return start.size(); }
    PairDirection leaving(size_t pair) const {
        if (!bends.empty()) return bends[pair].leaving;
        const uint32_t d = direction[pair];
        return {directions.x[d], directions.y[d], directions.z[d]};
    }
    PairDirection arriving_at(size_t pair) const {
        return bends.empty() ? leaving(pair) : bends[pair].arriving;
    }
    float solid_angle_of(size_t pair) const {
        const float all = static_cast<float>(solid_angle);
        return bends.empty() ? all : all * bends[pair].growth;
    }
};

// Directions are shared by every `subset`-th block of 32 facets alone, in a pattern that moves on by one
// block from direction to direction: the angular quadrature is what lobes need, and this way it has `subset`
// times more directions for the same number of pairs. offset in [0, subset) randomises the pattern. jitter:
// one place inside the facets per direction.
PairGraph trace_pairs(const MarchGrid& grid, const Tile& tile, const DirectionSet& set,
                      const std::vector<SubSample>& jitter, int subset, int offset, int n_threads,
                      const Monitor& monitor);

// How many blocks to a direction suit so many directions on a tile: at least eight directions a facet.
int facet_subset(const Tile& tile, const BaseCurvature& base, int n_directions);

struct GraphOptions {
    int max_order = 0;         // 0: all; K: orders 2..K
    int fixed_orders = 0;      // > 0: just so many, whatever the tolerance: runs that are averaged must agree
    bool keep_orders = false;  // a product for each order instead of one for their sum
    double tolerance = 1e-4;   // of GraphOrders::remainder
};

// Lights x views, in the units of add_direct: sums over the core.
struct GraphOrders {
    std::vector<Matrix> orders;  // [k] is order k + 2 if kept apart; else one matrix, the sum of all
    int n_orders = 0;
    double ratio = 0;  // of one order to the one before, at the end
    // Doubt about what comes after, relative to the light that comes in: all of it, or what its continuation
    // by `ratio` (part of the sum) may be wrong. 0 for limited orders.
    double remainder = 0;
    double heaviest = 0;  // largest share of its light that one pair passes on to another: > 1 where the lobe
                          // is narrower than the directions are dense
};

// A block of directions and their visible cosines: columns [first, first + directions.n).
struct GraphSide {
    DirectionArrays directions;
    const VisibleCosines* visible = nullptr;
    size_t first = 0;  // multiple of 16
    // The directions are lights turned by these nodes (TurnNodes::turned), and results are for node 0.
    // Without them light does not turn on its way.
    const TurnNodes* nodes = nullptr;

    int n_lights() const { return directions.n / (nodes ? nodes->count() : 1); }
};

GraphOrders scatter_orders(const PairGraph& graph, const Tile& tile, const SlotMaterial& material,
                           const GraphSide& lights, const GraphSide& views, const GraphOptions& options,
                           int n_threads, const Monitor& monitor);

// rms of the turns along the pairs, radians; 0 on a flat base.
double rms_turn(const PairGraph& graph);

// The radiance that arrives over every pair, [pair][n_lights padded to a multiple of 16], of all orders
// together: what a facet p sends to a view is its first order and the sum over its pairs of omega <n_p, d_i>
// f(n_p; d_i, v) times that. For pictures. `series`: as scatter_orders says, without orders.
HugeFloats arriving_light(const PairGraph& graph, const Tile& tile, const SlotMaterial& material,
                          const GraphSide& lights, const GraphOptions& options, int n_threads,
                          const Monitor& monitor, GraphOrders& series);

// R_1, from wherever it comes: [pair][columns]; and the light that arrives on facets directly, sum over area
// and columns of their irradiance, by which the orders beyond are judged.
struct FirstOrder {
    HugeFloats radiance;
    double arrived = 0;
};
// columns: a multiple of 16.
HugeFloats arriving_light(const PairGraph& graph, const Tile& tile, const SlotMaterial& material,
                          FirstOrder first, size_t columns, const GraphOptions& options, int n_threads,
                          const Monitor& monitor, GraphOrders& series);

// Memory of scatter_orders beside the graph, bytes.
double scatter_bytes(double n_pairs, int n_lights, int n_views);

}  // namespace gonio
