#include "measure/simplify.h"

#include <algorithm>

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
    for (int j = 0; j < s.ny; ++j)
        for (int i = 0; i < s.nx; ++i)
            t.heights[static_cast<size_t>(i) * t.nx + j] = s.heights[static_cast<size_t>(j) * s.nx + i];
    return t;
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

SimplifiedScene simplify_scene(const HeightField& surface, const Lambertian& material, bool allow_skips) {
    SimplifiedScene scene{surface, material, false, {}};
    HeightField& s = scene.surface;
    if (allow_skips && !material.albedo.is_map()) {
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
        if (material.albedo.is_map())
            std::swap(scene.material.albedo.map_nx,
                      scene.material.albedo.map_ny);  // one column: the order of values stays
    }
    return scene;
}

}  // namespace gonio
