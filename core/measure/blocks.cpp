#include "measure/blocks.h"

#include <algorithm>

namespace gonio {

std::vector<Block> make_blocks(const MeasuredScene& scene, bool same, int most, int most_sparse) {
    const int n_lights = static_cast<int>(scene.lights.size()),
              n_views = static_cast<int>(scene.views.size());
    std::vector<Block> blocks;
    if (same) {
        Block block;
        block.same = true;
        for (int l = 0; l < n_lights; ++l) block.lights.push_back(l);
        for (size_t r = 0; r < scene.rows(); ++r) {
            const auto [i, o] = scene.plan->pairs.empty()
                                    ? std::pair{static_cast<int>(r / n_views), static_cast<int>(r % n_views)}
                                    : scene.plan->pairs[r];
            block.rows.push_back({r, i, scene.view_to_light[o]});
        }
        blocks.push_back(std::move(block));
        return blocks;
    }
    if (scene.plan->pairs.empty()) {
        for (int l = 0; l < n_lights; l += most)
            for (int v = 0; v < n_views; v += most) {
                Block block;
                for (int i = l; i < std::min(n_lights, l + most); ++i) block.lights.push_back(i);
                for (int o = v; o < std::min(n_views, v + most); ++o) block.views.push_back(o);
                for (size_t i = 0; i < block.lights.size(); ++i)
                    for (size_t o = 0; o < block.views.size(); ++o)
                        block.rows.push_back({static_cast<size_t>(block.lights[i]) * n_views + block.views[o],
                                              static_cast<int>(i), static_cast<int>(o)});
                blocks.push_back(std::move(block));
            }
        return blocks;
    }
    // A list of pairs is answered from products of few directions each: sparse lists would waste larger ones.
    const double density = static_cast<double>(scene.rows()) / (static_cast<double>(n_lights) * n_views);
    if (density < 0.1) most = std::min(most, most_sparse);
    std::vector<int> light_at(n_lights, -1), view_at(n_views, -1);
    Block block;
    auto flush = [&] {
        for (const int l : block.lights) light_at[l] = -1;
        for (const int v : block.views) view_at[v] = -1;
        blocks.push_back(std::move(block));
        block = {};
    };
    for (size_t r = 0; r < scene.rows(); ++r) {
        const auto [i, o] = scene.plan->pairs[r];
        const bool new_light = light_at[i] < 0, new_view = view_at[o] < 0;
        if ((new_light && static_cast<int>(block.lights.size()) == most) ||
            (new_view && static_cast<int>(block.views.size()) == most))
            flush();
        if (light_at[i] < 0) {
            light_at[i] = static_cast<int>(block.lights.size());
            block.lights.push_back(i);
        }
        if (view_at[o] < 0) {
            view_at[o] = static_cast<int>(block.views.size());
            block.views.push_back(o);
        }
        block.rows.push_back({r, light_at[i], view_at[o]});
    }
    flush();
    return blocks;
}

}  // namespace gonio
