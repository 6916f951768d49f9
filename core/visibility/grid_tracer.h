// Rays in no common direction (reflected, lobe-sampled), as many side by side as a vector has lanes: each
// walks the cells of the relief, and jumps where a sliding maximum says that nothing reaches it. Exactly
// periodic, any number of cells, no tree. Rays go in lockstep rounds; after each, those that are done leave
// and the rest close ranks.
//
// A ray has hit once it is more than hit_tolerance below the facet's plane at an edge; nothing else is
// tolerated, so a ray cannot pass between facets, and one that starts on its facet does not meet it.
#pragma once
#include <cstdint>
#include <vector>

#include "directions/direction.h"
#include "surface/height_field.h"

namespace gonio {

inline constexpr int jump_cells[2] = {6, 24};

struct TraceGrid {
    int nx = 0, ny = 0;
    double aspect = 1;              // pitch_x / pitch_y
    float lowest = 0, highest = 0;  // in pitch_x, as all heights here
    float hit_tolerance = 0;        // 1e-6 of highest - lowest: what 100 roundings of a ray's height come to
    std::vector<float> corners;     // [cell][4]: nodes (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)
    // [cell]: highest node that a ray from anywhere in the cell can come by within jump_cells[k] cells.
    std::vector<float> highest_near[2];
};

// Throws Error(limit) for more than 2^28 cells.
TraceGrid make_trace_grid(const HeightField& surface);

// Rays as parallel arrays, their first n elements. Cell (i, j) in [0, nx) x [0, ny), place (u, v) in [0, 1]
// inside it, height z; direction in cells along x and y and pitch_x along z, of any length.
struct RayBatch {
    size_t n = 0;
    std::vector<int32_t> i, j;
    std::vector<float> u, v, z, dx, dy, dz;
    std::vector<int32_t> id;    // the caller's, kept
    std::vector<int32_t> kind;  // of hits: the facet, 0 or 1 as in facet_mesh.h

    // Room for `capacity` rays and for whatever a vector writes beyond them.
    void reserve(size_t capacity);
    size_t capacity() const { return i.size() - padding; }
    // A ray from (u, v) in cell (i, j), at height z, along a metric direction.
    void add(const TraceGrid& grid, int cell_i, int cell_j, float place_u, float place_v, float height,
             const Vec3& direction, int32_t ray_id) {
        const size_t k = n++;
        i[k] = cell_i, j[k] = cell_j, u[k] = place_u, v[k] = place_v, z[k] = height;
        dx[k] = static_cast<float>(direction.x);
        dy[k] = static_cast<float>(direction.y * grid.aspect);
        dz[k] = static_cast<float>(direction.z);
        id[k] = ray_id;
    }

    static constexpr size_t padding = 64;
};

// Height of the plane of a facet at (u, v) of its cell.
float facet_height(const TraceGrid& grid, int kind, int i, int j, float u, float v);

// Traces all rays and leaves `rays` empty. `hits` and `escaped` must be other batches with room for rays.n;
// they are emptied first. A hit keeps its ray's direction and gets the place where it lies on the plane of
// its facet. Returns how many rays were given up, their ids in `lost`: nearly horizontal, still in the relief
// after max_steps cells or jumps.
size_t trace_rays(const TraceGrid& grid, RayBatch& rays, RayBatch& hits, RayBatch& escaped,
                  std::vector<int32_t>& lost, int max_steps = 16384);

}  // namespace gonio
