// The relief: a grid of heights with its pitch. Owns scale and wrapping; nobody else computes 1 / width or wraps an index.
#pragma once
#include <string>
#include <vector>

#include "base/numeric.h"
#include "surface/base_curvature.h"

namespace gonio {

// Periodic in x and y with periods nx * pitch_x, ny * pitch_y. Node (i, j) stands at (i pitch_x, j pitch_y): x along columns,
// y along rows, row 0 at y = 0. Heights are metres above `mean_height`, which is subtracted in double before the cast to float
// (float heights on an offset of 1e5 pitches change visible hits: shared/performance B).
struct HeightField {
    int nx = 0, ny = 0;
    double pitch_x = 0, pitch_y = 0;  // metres, > 0
    double mean_height = 0;           // metres
    std::vector<float> heights;       // nx * ny, row by row, metres above mean_height
    BaseCurvature base;               // of what stands at mean_height: flat unless a job says otherwise

    // An open surface is measured only inside the rectangle of cells [border_x, nx - border_x) x [border_y, ny - border_y): outside
    // it, rays could reach the edge of the patch. 0 for periodic and mirrored surfaces.
    int border_x = 0, border_y = 0;

    float at(int i, int j) const { return heights[static_cast<size_t>(wrap_index(j, ny)) * nx + wrap_index(i, nx)]; }
    double width() const { return nx * pitch_x; }
    double depth() const { return ny * pitch_y; }
};

// Checks sizes and that every height is finite (throws Error naming the first bad point by column and row), subtracts the mean.
// heights: nx * ny metres, row by row, row 0 at y = 0.
HeightField make_height_field(int nx, int ny, double pitch_x, double pitch_y, const std::vector<double>& heights);

// SHA-256 (hex) of sizes, pitches and heights: the surface's name in provenance.
std::string surface_hash(const HeightField& surface);

}  // namespace gonio
