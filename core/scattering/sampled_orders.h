// Orders of scattering 2 and up of narrow lobes: light goes where lobes send it, not where shared directions
// happen to look (pair_graph.h). Rays leave the facets that a light strikes, along the lobe of the facet,
// each with the same share of the flux; where one meets another facet, what that facet sends to every view is
// counted by its stored visibility, without shadow rays, and the ray goes on along the lobe there. Slower
// than pairs for wide lobes, unbiased for all of them (shared/performance_glossy A3, "FS"). Flat bases only.
#pragma once
#include <cstdint>
#include <vector>

#include "base/monitor.h"
#include "material/material.h"
#include "scattering/pair_graph.h"
#include "visibility/grid_tracer.h"

namespace gonio {

struct SamplingOptions {
    int first_order = 2;  // orders below are followed, but not counted
    int max_order = 0;    // 0: all, that is most_sampled_orders
    bool keep_orders = false;
    double tolerance = 1e-4;       // SampledOrders::n_orders counts orders down to this share of the light
    double rays_per_facet = 0.25;  // and light
    // Of the random numbers. Those of a light have counters from (its number + 1) << 40 + (tile << 30) on.
    uint64_t seed = 0, stream = 0;
    uint64_t tile_number = 0;
    std::vector<int> light_numbers;  // one a light
};
inline constexpr int most_sampled_orders = 64;

// What the rays of a tile meet; the referred ones must outlive it.
struct SampledScene {
    const HeightField& surface;
    const TraceGrid& grid;
    const Material& material;
    const Tile& tile;
    // Channels that differ by more than a factor each have a row of weights; materials[g] is that of channel
    // channels[g].
    std::vector<size_t> channels;
    const std::vector<SlotMaterial>& materials;
};

// Lights x views, in the units of add_direct: sums over the core.
struct SampledOrders {
    // [channel][k]: order first_order + k if kept apart, else the sum of all.
    std::vector<std::vector<Matrix>> orders;
    int n_orders = 0;      // the last order that counts, less one: as GraphOrders of all orders from 2 on
    double remainder = 0;  // share of the light that was still on its way after the last of all orders
    double rays = 0, rays_lost = 0;
};

// Lights and views without nodes, from column 0 on. The same bits for any number of threads.
SampledOrders sample_orders(const SampledScene& scene, const GraphSide& lights, const GraphSide& views,
                            const SamplingOptions& options, int n_threads, const Monitor& monitor);

}  // namespace gonio
