// Horizons of all receivers along one azimuth by a convex-hull sweep (Timonen, Westerholm 2010 [1], sec.
// 4-5).
//
// Samples of the relief stand on sheared lines, one line a row and one sample a column, so that neighbouring
// lines go in lockstep through contiguous loads. The stack of [1] is kept as a linked hull: next[c] is the
// sample where the tangent from sample c touches the relief ahead; from far to near, c's own tangent is found
// by walking that list from c + 1 while the slope does not fall. A push is one contiguous store.
//
// Receivers stand between two lines, and [1]'s interpolation between lines has an rms of 1e-2 rad
// (shared/performance_techniques 1). Instead the two lines only say where to look: the receiver's own ray is
// evaluated at the columns around both tangent points, at the other edges next to the best, and at its first
// few edges.
#pragma once
#include "visibility/horizon_map.h"

namespace gonio {

// Both orientations of the grid must be there, and wide enough for the lanes: else the march is as good.
bool can_sweep(const MarchGrid& grid);

// flat: the first crossings of the receivers' own horizontal rays, which fix azimuth and receiver. travel:
// cells that are looked at ahead of every receiver, at least.
HorizonSlice sweep_horizon(const MarchGrid& grid, const RayBundle& flat, double travel);

}  // namespace gonio
