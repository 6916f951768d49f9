#include "measure/graph_mesh.h"

#include <cmath>

#include "measure/windows.h"
#include "visibility/crossings.h"

namespace gonio {
namespace {

// Each value becomes the mean over the parts of its facet that a refinement of half would not tell apart.
VisibleCosines averaged(const Tile& tile, const VisibleCosines& fine) {
    const int coarse = tile.refinement / 2;
    std::vector<std::vector<int>> children(static_cast<size_t>(coarse) * coarse);
    for (int part = 0; part < tile.n_parts(); ++part) {
        const FacetPoint centroid = facet_point(0, 2.0 / 3, 1.0 / 3, tile.refinement, part);
        children[facet_part(0, centroid.u, centroid.v, coarse)].push_back(part);
    }
    VisibleCosines mean = fine;
    std::vector<float> sum(fine.stride);
    for (const std::vector<int>& group : children)
        for (size_t slot = 0; slot < tile.n_slots(); ++slot) {
            std::fill(sum.begin(), sum.end(), 0.0f);
            for (const int part : group)
                for (size_t c = 0; c < fine.stride; ++c) sum[c] += fine.of(part * tile.n_slots() + slot)[c];
            for (const int part : group)
                for (size_t c = 0; c < fine.stride; ++c)
                    mean.values[(part * tile.n_slots() + slot) * fine.stride + c] =
                        sum[c] / static_cast<float>(group.size());
        }
    return mean;
}

struct TwoGrids {
    Matrix fine, difference;
};

}  // namespace

double measure_graph_mesh(const GraphContext& context, const RunSettings& settings, int n_threads,
                          const Monitor& monitor) {
    const Tile tile = probe_tile(context, settings, 2 * settings.refinement);
    const std::vector<Vec3> probes = probe_directions(context);
    const DirectionArrays arrays(probes);
    const SlotMaterial material = slot_material(*context.material, *context.surface, tile,
                                                context.channel_groups.front().channels.front());
    RunSettings finer = settings;
    finer.directions *= 4;
    GraphOptions second_order;
    second_order.max_order = 2;
    TwoGrids found[2];
    for (int k = 0; k < 2; ++k) {
        // Random numbers that no run has: of a stage that there is not.
        const RunShifts shifts(context.plan->accuracy.seed, 1 << 20, k);
        const PairGraph graph = run_pairs(context, finer, tile, shifts, n_threads, monitor);
        VisibleCosines fine;
        const std::vector<SubSample> samples = shifted_sub_samples(4, shifts(2), shifts(3));
        add_cosines(
            tile, probes,
            find_visibility(*context.grid, tile, probes, samples, context.allow_skips, n_threads, monitor),
            0.25, n_threads, fine);
        const VisibleCosines coarse = averaged(tile, fine);
        auto order = [&](const VisibleCosines& visible) {
            const GraphSide side{arrays, &visible, 0};
            return scatter_orders(graph, tile, material, side, side, second_order, n_threads, monitor)
                .orders[0];
        };
        found[k].fine = order(fine);
        found[k].difference = order(coarse);
        for (size_t i = 0; i < found[k].fine.values.size(); ++i)
            found[k].difference.values[i] -= found[k].fine.values[i];
    }
    double common = 0, all = 0;
    for (size_t i = 0; i < found[0].fine.values.size(); ++i) {
        common += found[0].difference.values[i] * found[1].difference.values[i];
        all += found[0].fine.values[i] * found[1].fine.values[i];
    }
    return all > 0 ? 4.0 / 3 * safe_sqrt(common / all) : 0.0;
}

}  // namespace gonio
