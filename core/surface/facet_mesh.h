// The geometry that is simulated: two flat triangles a cell, diagonal (i,j)-(i+1,j+1). Facet 0 ("lower", u >=
// v) has the corners (i,j), (i+1,j), (i+1,j+1); facet 1 ("upper", v > u) has (i,j), (i+1,j+1), (i,j+1). Exact
// normals: texel-centre points with central-difference normals bias the direct term by 0.2-4 %
// (shared/performance E), which no number of directions removes.
#pragma once
#include <cmath>

#include "surface/height_field.h"

namespace gonio {

struct Gradient {
    double x = 0, y = 0;  // dh/dx, dh/dy of a facet
};

// Gradient of facet `kind` (0 or 1) of cell (i, j); indices wrap.
inline Gradient facet_gradient(const HeightField& s, int kind, int i, int j) {
    const double h00 = s.at(i, j), h11 = s.at(i + 1, j + 1);
    if (kind == 0) {
        const double h10 = s.at(i + 1, j);
        return {(h10 - h00) / s.pitch_x, (h11 - h10) / s.pitch_y};
    }
    const double h01 = s.at(i, j + 1);
    return {(h11 - h01) / s.pitch_x, (h01 - h00) / s.pitch_y};
}

// Area of a facet over its projected area.
inline double area_ratio(const Gradient& g) {
    return std::sqrt(1 + g.x * g.x + g.y * g.y);
}

}  // namespace gonio
