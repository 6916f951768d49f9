#include "measure/simplify.h"

#include <algorithm>
#include <variant>

#include "material/lobe_parameters.h"

namespace gonio {
namespace {

bool rows_alike(const HeightField& s) {
    for (int j = 1; j < s.ny; ++j)
        if (!std::equal(s.heights.begin(), s.heights.begin() + s.nx,
                        s.heights.begin() + static_cast<long>(j) * s.nx))
            return false;
    return true;
}

bool columns_alike(const HeightField& s) {
    for (int j = 0; j < s.ny; ++j) {
        const auto row = s.heights.begin() + static_cast<long>(j) * s.nx;
        if (!std::all_of(row, row + s.nx, [&](float h) { return h == *row; })) return false;
    }
    return true;
}

HeightField swap_axes(const HeightField& s) {
    HeightField t = s;
    std::swap(t.nx, t.ny);
    std::swap(t.pitch_x, t.pitch_y);
    std::swap(t.border_x, t.border_y);
    t.base = s.base.axes_swapped();
    for (int j = 0; j < s.ny; ++j)
        for (int i = 0; i < s.nx; ++i)
            t.heights[static_cast<size_t>(i) * t.nx + j] = s.heights[static_cast<size_t>(j) * s.nx + i];
    return t;
}

// Of one row or one column: the order of a map's values stays. A lobe that was turned from x towards y is
// turned from y towards x.
void swap_axes(Material& material) {
    auto swap_map = [](Parameter& p) { std::swap(p.map_nx, p.map_ny); };
    for (WeightedLobe& part : material.lobes) {
        swap_map(part.weight);
        std::visit(
            [&](auto& lobe) {
                visit_parameters(lobe,
                                 [&](const char*, Parameter& p, const ParameterRange&) { swap_map(p); });
            },
            part.lobe);
        if (auto* microfacet = std::get_if<Microfacet>(&part.lobe)) {
            for (double& turn : microfacet->rotation_deg.constant) turn = 90 - turn;
            for (float& turn : microfacet->rotation_deg.map) turn = 90 - turn;
        }
    }
}

void keep_one_row(HeightField& s) {
    s.heights.resize(s.nx);
    s.ny = 1;
    s.border_y = 0;
}

}  // namespace

bool is_plane(const HeightField& surface) {
    return std::all_of(surface.heights.begin(), surface.heights.end(),
                       [&](float h) { return h == surface.heights.front(); });
}

bool has_maps(const Material& material) {
    bool found = false;
    for (const WeightedLobe& part : material.lobes) {
        found = found || part.weight.is_map();
        std::visit(
            [&](const auto& lobe) {
                visit_parameters(lobe, [&](const char*, const Parameter& p, const ParameterRange&) {
                    found = found || p.is_map();
                });
            },
            part.lobe);
    }
    return found;
}

SimplifiedScene simplify_scene(const HeightField& surface, const Material& material, bool allow_skips) {
    SimplifiedScene scene{surface, material, false, {}};
    HeightField& s = scene.surface;
    if (allow_skips && !has_maps(material)) {
        if (s.ny > 1 && rows_alike(s)) {
            keep_one_row(s);
            scene.skipped.push_back({"all rows but one", "the surface does not change along y"});
        } else if (s.nx > 1 && columns_alike(s)) {
            s = swap_axes(s);
            scene.axes_swapped = true;
            keep_one_row(s);
            scene.skipped.push_back({"all columns but one", "the surface does not change along x"});
        }
    }
    if (s.nx == 1 && s.ny > 1) {
        s = swap_axes(s);
        scene.axes_swapped = !scene.axes_swapped;
    }
    if (scene.axes_swapped) swap_axes(scene.material);
    return scene;
}

}  // namespace gonio
