// The lockstep march: all rays of one bundle from a rectangle of cells, 16 at a time. Two contiguous loads,
// two fused multiply-adds and one compare test 16 rays against one edge: no gather, no tree, no epsilon, no
// self-hit, exact periodicity. Kernels are compiled for SSE4, AVX2 and AVX-512 and chosen at run time; they
// differ by fused or separate roundings, so bits are the same for any number of threads but may differ
// between instruction sets (the table says which one ran).
#pragma once
#include <cstdint>
#include <vector>

#include "visibility/crossings.h"

namespace gonio {

// Number of 32-bit words that hold one bit for each of `width` cells, padded to march_block.
inline int words_for(int width) {
    return (width + march_block - 1) / march_block;
}

// visible[row * words_for(width) + word]: bit c set if the ray from cell (32 word + c, row) of the rectangle
// leaves its facet's front and meets nothing. Bits beyond the width are 0. `rect` is in untransposed cells,
// and so is the result, whichever way it marches.
// Rays that are not of the bundle (RayBundle::heights) count as hidden.
void march_visible(const MarchGrid& grid, const RayBundle& bundle, const CellRect& rect, uint32_t* visible);

// The same for all rays of a direction, in as many bundles as it needs. Returns whether one was truncated.
bool visible_along(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start, double max_travel,
                   const CellRect& rect, uint32_t* visible);

// The scattering map S_i of one bundle, some lanes of it: for the `n_lines` lines of cells that start at
// (column, row) and are `width` long, which crossing is the first below the relief. Lines run along x, or
// along y where the bundle is transposed (then column is the y of their first cell and row the x of the first
// line).
struct HitLines {
    std::vector<uint32_t> hit;    // [line][word], as `visible` above: the ray hits
    std::vector<uint32_t> front;  // [line][word]: the ray leaves the facet's front
    std::vector<int32_t>
        crossing;  // [line][32 words]: index of the crossing behind the hit facet; garbage where not hit
};
void march_hits(const MarchGrid& grid, const RayBundle& bundle, int column, int row, int width, int n_lines,
                HitLines& out);

// Horizon of every cell of the rectangle along the bundle's horizontal direction (its rise is not used):
// largest (height of the relief - height of the start) / horizontal travel over the break points of the
// profile, which is exact for the mesh; never below 0. Of the flat relief: see make_level_bundle. slope is
// metric (tan of the elevation). slope[row * width + column] in untransposed cells. distance: horizontal,
// metres, to the break point that is the horizon, 0 where none stands higher than the start; left out if
// null.
void march_horizon(const MarchGrid& grid, const RayBundle& bundle, const CellRect& rect, float* horizon_slope,
                   float* horizon_distance = nullptr);

// "AVX3", "AVX2", "SSE4", ...: the kernels that run on this machine.
const char* simd_target();
// For tests and benchmarks: run the kernels of one target from now on ("" for the best). Returns false if
// this machine or this build lacks it. Not to be called while kernels run.
bool force_simd_target(const char* name);

}  // namespace gonio
