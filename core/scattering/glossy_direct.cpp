#include "scattering/glossy_direct.h"

#include <algorithm>

#include "base/parallel.h"

namespace gonio {

void add_direct(const SlotMaterial& material, const Tile& tile, const DirectionArrays& lights,
                const DirectionArrays& views, bool same, const VisibilityBits& light_bits,
                const VisibilityBits& view_bits, double share, int n_threads, const Monitor& monitor,
                Matrix& sums) {
    const std::vector<float> area = core_areas(tile);
    std::vector<std::pair<size_t, size_t>> stretches;  // part, first slot: those with measured facets
    for (int part = 0; part < tile.n_parts(); ++part)
        for (size_t first = 0; first < tile.n_slots(); first += direct_chunk) {
            const size_t end = std::min(first + direct_chunk, tile.n_slots());
            if (std::any_of(&area[first], &area[first] + (end - first), [](float a) { return a > 0; }))
                stretches.push_back({static_cast<size_t>(part), first});
        }
    // A fixed number of groups, each with its own sum: few where the sums are large.
    const size_t size = static_cast<size_t>(lights.n) * views.n;
    const int n_groups =
        static_cast<int>(std::clamp<size_t>((size_t{64} << 20) / (size * sizeof(double)), 2, 16));
    std::vector<std::vector<double>> partial(n_groups);
    parallel_for(n_groups, n_threads, [&](int group) {
        partial[group].assign(size, 0.0);
        DirectScratch scratch(lights, views);
        const size_t begin = stretches.size() * group / n_groups,
                     end = stretches.size() * (group + 1) / n_groups;
        for (size_t k = begin; k < end; ++k) {
            monitor.check_cancelled();
            const auto [part, first] = stretches[k];
            DirectSlots slots;
            slots.first = first;
            slots.count = std::min(direct_chunk, tile.n_slots() - first);
            slots.area = area.data();
            slots.n_sub_samples = light_bits.n_sub_samples;
            slots.light_bits = light_bits.of(0) + part * tile.n_slots() + first;
            slots.light_stride = light_bits.n_unknowns;
            slots.view_bits = (same ? light_bits : view_bits).of(0) + part * tile.n_slots() + first;
            slots.view_stride = slots.light_stride;
            add_direct_sums(material, tile, slots, lights, views, same, scratch, partial[group].data());
        }
    });
    for (int l = 0; l < lights.n; ++l)
        for (int v = same ? l : 0; v < views.n; ++v) {
            double total = 0;
            for (const auto& p : partial) total += p[static_cast<size_t>(l) * views.n + v];
            sums(l, v) += share * total;
            if (same && v > l) sums(v, l) += share * total;
        }
}

}  // namespace gonio
