#include "measure/windows.h"

#include <algorithm>
#include <cmath>

namespace gonio {

Tile whole_tile(const MeasuredScene& scene, const RunSettings& settings) {
    const HeightField& s = *scene.surface;
    return make_tile(s, {0, 0, s.nx, s.ny},
                     {s.border_x, s.border_y, s.nx - 2 * s.border_x, s.ny - 2 * s.border_y},
                     settings.refinement);
}

std::vector<Tile> run_tiles(const MeasuredScene& scene, const RunSettings& settings, double shift_x,
                            double shift_y) {
    const HeightField& s = *scene.surface;
    if (settings.tiles_x == 0) {
        std::vector<Tile> tiles;
        tiles.push_back(whole_tile(scene, settings));
        return tiles;
    }
    // A randomly shifted lattice of windows: with as many as fit it covers the surface once. The inner
    // rectangle of an open surface does not wrap, and windows anywhere inside it would see its middle more
    // often than its rim: there the lattice picks cells of a fixed partition.
    const int inner_x = s.nx - 2 * s.border_x, inner_y = s.ny - 2 * s.border_y;
    const bool open = s.border_x > 0 || s.border_y > 0;
    struct Span {
        int start, length;
    };
    auto span = [&](int i, int n, double shift, int inner, int border) {
        const double place = (i + shift) / n;
        if (!open) return Span{static_cast<int>(place * inner), std::min(tile_core, inner)};
        const int cells = (inner + tile_core - 1) / tile_core, cell = static_cast<int>(place * cells);
        const int begin = inner * cell / cells;
        return Span{border + begin, inner * (cell + 1) / cells - begin};
    };
    std::vector<Tile> tiles;
    for (int b = 0; b < settings.tiles_y; ++b)
        for (int a = 0; a < settings.tiles_x; ++a) {
            const auto [x, core_x] = span(a, settings.tiles_x, shift_x, inner_x, s.border_x);
            const auto [y, core_y] = span(b, settings.tiles_y, shift_y, inner_y, s.border_y);
            const int halo_x = std::min(tile_halo, (s.nx - core_x) / 2),
                      halo_y = std::min(tile_halo, (s.ny - core_y) / 2);
            const CellRect area{wrap_index(x - halo_x, s.nx), wrap_index(y - halo_y, s.ny),
                                core_x + 2 * halo_x, core_y + 2 * halo_y};
            tiles.push_back(make_tile(s, area, {halo_x, halo_y, core_x, core_y}, settings.refinement));
        }
    return tiles;
}

std::vector<Vec3> probe_directions(const MeasuredScene& scene) {
    constexpr size_t most = 16;
    std::vector<Vec3> chosen, all = scene.lights;
    if (scene.view_to_light.empty()) all.insert(all.end(), scene.views.begin(), scene.views.end());
    const size_t n = std::min(most, all.size());
    for (size_t k = 0; k < n; ++k) chosen.push_back(all[(2 * k + 1) * all.size() / (2 * n)]);
    return chosen;
}

Tile probe_tile(const MeasuredScene& scene, const RunSettings& settings, int refinement) {
    const HeightField& s = *scene.surface;
    // A long and narrow surface is small, too, and a part of it may miss what matters (one wall of a groove).
    const bool whole =
        settings.tiles_x == 0 && static_cast<double>(s.nx) * s.ny <= std::pow(tile_core + 2.0 * tile_halo, 2);
    if (whole) return make_tile(s, {0, 0, s.nx, s.ny}, {0, 0, s.nx, s.ny}, refinement);
    const int width = std::min(s.nx, tile_core), height = std::min(s.ny, tile_core),
              halo_x = std::min(tile_halo, (s.nx - width) / 2),
              halo_y = std::min(tile_halo, (s.ny - height) / 2);
    const CellRect area{wrap_index((s.nx - width) / 2 - halo_x, s.nx),
                        wrap_index((s.ny - height) / 2 - halo_y, s.ny), width + 2 * halo_x,
                        height + 2 * halo_y};
    return make_tile(s, area, {halo_x, halo_y, width, height}, refinement);
}

}  // namespace gonio
