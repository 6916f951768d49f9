// One randomised run of the glossy engine: exact direct term, pair graph for the orders beyond.
#pragma once
#include <algorithm>

#include "measure/run.h"
#include "scattering/pair_graph.h"

namespace gonio {

// From order 3 on the same directions are used more than once, and E[R R] is not E[R] E[R]: what that shifts
// the indirect part by, over the scatter of single runs. 0.06 to 0.14 for GGX 0.15, 0.3 and a mixture on
// three reliefs at 16 to 256 directions, 12 to 60 tables each against longer runs on parts of a quarter of
// the width.
inline constexpr double shared_directions_doubt = 0.12;

// What the runs of a job by the pair graph share.
struct GraphContext : MeasuredScene {
    std::vector<ChannelGroup> channel_groups;
    bool indirect = true;  // false: the relief is too gentle for light to be scattered twice
    double series_tolerance = 1e-4;
    int single_orders = 0;  // slices of single orders to keep; 0: as many as the first run gives

    bool transports() const { return indirect && plan->max_order != 1; }
    // Orders are needed one by one.
    bool keep_orders() const;
};

RunValues graph_run(const GraphContext& context, const RunSettings& settings, int stage, int run,
                    int n_threads, const Monitor& monitor);

// Working memory of one run, bytes, for so many lights and views at a time.
double graph_run_bytes(const GraphContext& context, const RunSettings& settings, int n_lights, int n_views);

// What the lobes of a material that lie along the normal send over one of the pairs that start at a facet, of
// all they reflect: so much narrower than the shared directions are dense they are.
double lobe_share_of_pair(const Material& material, const MarchGrid& grid, const Tile& tile,
                          int n_directions);
// Above that, few chains meet lobes, and those carry too much. Of single orders into 16 cells at 64
// directions (relief of slope 0.5) 3 stated errors held the truth of order 3 in 96, 90, 84, 77, 72 % where a
// pair took 1.3 (GGX 0.3), 5, 12, 32, 130; that of order 2 in 100, 99, 99, 96, 86 %, and 49 % at 1200.
inline constexpr double most_honest_share = 2;
// From there on lobes count as narrow (narrow_lobes.h) and orders 3 and up are followed by rays, and from the
// other on order 2, too. Up to 6, order 2, which its errors do tell, is nearly all of the doubt: of a GGX of
// 0.15 (5) the sum of all orders was covered in 70, 92, 98 % by the scatter of pairs alone, which take a
// quarter of the time.
inline constexpr double narrow_share_of_pair = 6, most_share_of_order_2 = 16;

// The first order that is followed by rays along lobes (sampled_orders.h) instead of pairs; 0: none. Rays
// know flat bases only.
int first_sampled_order(const MeasuredScene& scene, const Tile& tile, int n_directions);
// Of a light and facet. As many as take about the time of so many directions.
double sampled_rays_per_facet(const RunSettings& settings);

// Pairs that leave a facet, of so many shared directions; share of rays inside the slab that hit.
double pairs_per_facet(const HeightField& surface, const Tile& tile, int n_directions);
inline double share_that_hits(double rms_slope) {
    return std::min(0.35, 0.1 + 0.08 * rms_slope);
}

// Shared directions of a run on a tile, and the pairs they give.
PairGraph run_pairs(const GraphContext& context, const RunSettings& settings, const Tile& tile,
                    const RunShifts& shifts, int n_threads, const Monitor& monitor);

}  // namespace gonio
