#include "scattering/tile.h"

#include <cmath>

#include "surface/facet_mesh.h"
#include "visibility/curvature.h"

namespace gonio {

std::vector<Tile::Run> Tile::core_runs() const {
    constexpr size_t longest = 1024;
    std::vector<Run> runs;
    for (int kind = 0; kind < 2; ++kind)
        for (int row = core.y0; row < core.y0 + core.height; ++row) {
            // Rows follow each other without a gap when the core is as wide as the tile (padding has no
            // area).
            const bool whole = core.width == area.width;
            const Run run{slot(kind, row, core.x0), static_cast<size_t>(whole ? stride : core.width)};
            if (whole && !runs.empty() && runs.back().first + runs.back().count == run.first &&
                runs.back().count + run.count <= longest)
                runs.back().count += run.count;
            else
                runs.push_back(run);
        }
    return runs;
}

Tile make_tile(const HeightField& surface, const CellRect& area, const CellRect& core, int refinement) {
    Tile tile;
    tile.area = area;
    tile.core = core;
    tile.nx = surface.nx;
    tile.ny = surface.ny;
    tile.stride = (area.width + march_block - 1) / march_block * march_block;
    tile.refinement = refinement;
    tile.closed_x = area.width == surface.nx;
    tile.closed_y = area.height == surface.ny;
    for (auto* field : {&tile.normal_x, &tile.normal_y, &tile.normal_z, &tile.sqrt_area})
        field->assign(tile.n_slots(), 0.0f);
    for (int kind = 0; kind < 2; ++kind)
        for (int row = 0; row < area.height; ++row)
            for (int column = 0; column < area.width; ++column) {
                const int i = area.x0 + column, j = area.y0 + row;
                const size_t s = tile.slot(kind, row, column);
                if (surface.base.is_curved()) {
                    const auto [normal, facet_area] = displaced_facet(surface, kind, i, j);
                    tile.normal_x[s] = static_cast<float>(normal.x);
                    tile.normal_y[s] = static_cast<float>(normal.y);
                    tile.normal_z[s] = static_cast<float>(normal.z);
                    tile.sqrt_area[s] = static_cast<float>(std::sqrt(facet_area / tile.n_parts()));
                    continue;
                }
                const Gradient g = facet_gradient(surface, kind, i, j);
                const double ratio = area_ratio(g);
                tile.normal_x[s] = static_cast<float>(-g.x / ratio);
                tile.normal_y[s] = static_cast<float>(-g.y / ratio);
                tile.normal_z[s] = static_cast<float>(1 / ratio);
                tile.sqrt_area[s] = static_cast<float>(std::sqrt(0.5 * ratio / tile.n_parts()));
            }
    return tile;
}

}  // namespace gonio
