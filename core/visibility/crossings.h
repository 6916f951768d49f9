// The list of grid-edge crossings that all parallel rays of one facet kind share (method of dependent tests,
// Heidrich et al. 2000, sec. 3.1, taken to its end): rays that start at the same place inside their cells
// pierce edges at the same relative positions, so where, with which weight and how high is computed once per
// direction, in double, and not per ray.
#pragma once
#include <array>
#include <limits>
#include <vector>

#include "visibility/march_grid.h"

namespace gonio {

// A place inside a facet: (u, v) in cells from the cell's corner (i, j); facet kind 0 has u >= v, kind 1 v >
// u.
struct FacetPoint {
    int kind = 0;
    double u = 2.0 / 3, v = 1.0 / 3;
};

// The point of facet kind `kind` for (a, b) in the unit square, kept 1e-4 cell away from the facet's edges so
// that no ray starts on one. The two kinds are each other's image under (u, v) -> (1 - u, 1 - v). refinement
// r and part p: the p-th of the r^2 congruent parts of the facet (part 0 alone for r = 1).
FacetPoint facet_point(int kind, double a, double b, int refinement = 1, int part = 0);

// The part of a facet that holds (u, v), the inverse of facet_point's `part`.
int facet_part(int kind, double u, double v, int refinement);

// One edge crossing. Columns and rows are relative to the ray's own cell, in [0, n); height along the edge at
// the crossing is weight0 * h[first node] + weight1 * h[first node + second_node]; `rise` is how far the ray
// has risen.
struct Crossing {
    float weight0, weight1, rise;
    int column, row;  // of the first node
    int second_node;  // floats from the first node to the second
};

// The facet that a ray crosses just before crossing k: where it has hit if crossing k is the first below the
// relief.
struct CrossedFacet {
    int column, row;  // of the cell, relative to the ray's cell, unwrapped (how far the hit is)
    int kind;
    float travel;  // cells from the start to crossing k
};

// A run of crossings whose nodes lie inside one window: skipped together when the window's maximum is below
// all rays.
struct CrossingGroup {
    int end;            // one past the last crossing
    int window;         // index of window_max, -1: test singly
    int column, row;    // of the window
    float lowest_rise;  // of the ray inside the window
    float scale = 1;    // of the window's maximum, see RayBundle::bent
};

// Where a ray stands over the base, in cells from the corner of its own, after some travel.
struct RayPath {
    double u = 0, v = 0, step_u = 0, step_v = 0;
    double bend_u = 0, bend_v = 0;  // 0 on flat bases and spheres
    std::array<double, 2> at(double travel) const {
        return {u + step_u * travel + bend_u * travel * travel,
                v + step_v * travel + bend_v * travel * travel};
    }
};

// On a base that is neither flat nor a sphere, the higher a ray runs the further it is carried sideways
// against its foot, so that rays from different heights share a path only nearly. Heights in cells.
struct StartHeights {
    double typical = 0;                                    // what the path is made for
    float from = -std::numeric_limits<float>::infinity(),  // of the rays of a bundle; others are not marched
        below = std::numeric_limits<float>::infinity();
    bool all() const { return from < -1e30f && below > 1e30f; }
};

struct RayBundle {
    FacetPoint start;
    MarchDirection direction;
    RayPath path;
    StartHeights heights;
    bool transposed = false;     // columns and rows swapped: marches in MarchGrid::transposed
    float start_weight[3] = {};  // of the nodes (i, j), the kind's own corner, (i+1, j+1)
    std::vector<Crossing> crossings;
    std::vector<CrossedFacet> facets;  // parallel to crossings
    std::vector<CrossingGroup> groups;
    bool truncated = false;  // longer than max_travel: rays may still be inside the relief at its end

    // On a curved base (surface/base_curvature.h) a ray of slope m that starts at height h0 passes below a
    // relief of height h at base distance d = gamma R if
    //     (R + h) (cos gamma - m sin gamma) > R + h0:
    // linear in h and h0, so that all rays (of one layer of start heights) still share one list. The weights
    // of its crossings carry C = cos gamma - m sin gamma, and `rise` is R (1 - C). Exact but for the sagitta
    // kappa pitch^2 / 8 of an edge. Along azimuths of no curvature a bundle is straight.
    bool bent = false;
    float kappa = 0;  // normal curvature times pitch_x
    // A ray has left once it has been above the highest point: what a hollow base does further away is
    // macroscopic, and the renderer's business. Crossing k is hit by no ray that starts above escape[k].
    std::vector<float> escape;  // parallel to crossings where the bundle is bent

    // Rays of a view: they start at `start_height` (in cells) above their start points instead of on the
    // relief, and fall.
    bool from_above = false;
    float start_height = 0;
};

// start.kind and start.u, v are in untransposed coordinates; the bundle holds transposed ones where it
// marches transposed. max_travel: cells after which a nearly horizontal ray is given up (counted as a miss).
// heights: which rays, of start_heights().
RayBundle make_ray_bundle(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                          double max_travel, const StartHeights& heights = {});

// The layers of start heights that together are all rays of a direction, one bundle each: as many as keep
// paths within 0.01 radians of those of their rays, one on flat bases, spheres and along principal
// directions.
std::vector<StartHeights> start_heights(const MarchGrid& grid, const Vec3& direction);

// The same for march_horizon, towards a horizontal direction and straight on any base: horizons are those of
// the flat relief, which visibility/curvature.h corrects.
RayBundle make_level_bundle(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                            double max_travel);

// Where a view ray that passes `height` (in cells) above the origin enters the layer of the relief, at its
// highest point: in cells from the origin, and the view as told in the frame of the base there.
struct ViewEntry {
    double x = 0, y = 0;
    Vec3 view;
};
ViewEntry view_entry(const MarchGrid& grid, const Vec3& view, double height);

// Rays that fall from the highest point of the relief along -view: `u`, `v` in [0, 1) is where, inside their
// cells, they pass that height. view.z > 0. A ray that falls has hit by the end of its list unless it was cut
// (truncated).
RayBundle make_view_bundle(const MarchGrid& grid, const Vec3& view, double u, double v, double max_travel);

}  // namespace gonio
