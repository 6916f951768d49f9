// Form removal by least squares. On a full grid the discrete Legendre polynomials 1, x, y, p2(x), x y, p2(y),
// with p2(x) = x^2 - mean(x^2) and x, y from the centre, are orthogonal, so each coefficient is one
// projection: no system to solve, none to be singular on grids of one or two rows.
#include <cmath>

#include "base/text.h"
#include "surface/prepare_steps.h"

namespace gonio {
namespace {

// Orthogonal polynomials of one axis at its n nodes, and their sums of squares.
struct Axis {
    std::vector<double> p1, p2;
    double norm1 = 0, norm2 = 0;
    explicit Axis(int n) : p1(n), p2(n) {
        // In units of the half side, so that squares neither overflow nor vanish.
        const double centre = (n - 1) / 2.0, mean_square = (static_cast<double>(n) * n - 1) / 12;
        for (int i = 0; i < n; ++i) {
            p1[i] = (i - centre) * (2.0 / n);
            p2[i] = ((i - centre) * (i - centre) - mean_square) * (4.0 / n / n);
            norm1 += p1[i] * p1[i];
            norm2 += p2[i] * p2[i];
        }
    }
};

struct Form {
    double mean = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
};

double projection(double product, double norm) {
    return norm > 0 ? product / norm : 0;
}

Form fit(const Grid& grid, const Axis& ax, const Axis& ay) {
    Form sums;
    for (int j = 0; j < grid.ny; ++j) {
        const double* row = &grid.heights[static_cast<size_t>(j) * grid.nx];
        double h0 = 0, h1 = 0, h2 = 0;
        for (int i = 0; i < grid.nx; ++i) {
            h0 += row[i];
            h1 += row[i] * ax.p1[i];
            h2 += row[i] * ax.p2[i];
        }
        sums.mean += h0;
        sums.x += h1;
        sums.xx += h2;
        sums.y += h0 * ay.p1[j];
        sums.yy += h0 * ay.p2[j];
        sums.xy += h1 * ay.p1[j];
    }
    const double nx = grid.nx, ny = grid.ny;
    return {sums.mean / (nx * ny),
            projection(sums.x, ax.norm1 * ny),
            projection(sums.y, ay.norm1 * nx),
            projection(sums.xx, ax.norm2 * ny),
            projection(sums.xy, ax.norm1 * ay.norm1),
            projection(sums.yy, ay.norm2 * nx)};
}

}  // namespace

std::string level_heights(Grid& grid, Level level, double pitch_x, double pitch_y) {
    if (level == Level::none) return "";
    const Axis ax(grid.nx), ay(grid.ny);
    Form form = fit(grid, ax, ay);
    if (level == Level::mean) form = {form.mean};
    if (level == Level::plane) form = {form.mean, form.x, form.y};
    for (int j = 0; j < grid.ny; ++j) {
        double* row = &grid.heights[static_cast<size_t>(j) * grid.nx];
        const double constant = form.mean + form.y * ay.p1[j] + form.yy * ay.p2[j],
                     slope = form.x + form.xy * ay.p1[j];
        for (int i = 0; i < grid.nx; ++i) row[i] -= constant + slope * ax.p1[i] + form.xx * ax.p2[i];
    }

    if (level == Level::mean) return "levelled: mean height " + number_text(form.mean, 6) + " m subtracted";
    const double per_x = 2.0 / grid.nx / pitch_x, per_y = 2.0 / grid.ny / pitch_y;  // d p1 / dx in 1/m
    std::string note = std::string("levelled by a ") + (level == Level::plane ? "plane" : "quadratic") +
                       " (slopes " + number_text(form.x * per_x, 4) + " in x, " +
                       number_text(form.y * per_y, 4) + " in y";
    if (level == Level::quadratic)
        note += "; curvatures " + number_text(2 * form.xx * per_x * per_x, 4) + "/m in x, " +
                number_text(2 * form.yy * per_y * per_y, 4) + "/m in y";
    return note + ")";
}

}  // namespace gonio
