// Receivers of finite size: patches of the upper hemisphere between two polar angles and two azimuths, in
// rings of equal sectors. A table over cells holds the mean of f over each cell, weighted by the cosine: cell
// flux / (E0 * projected solid angle). What mirrors and narrow lobes need: at a point direction their f is a
// sum of delta functions.
#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "directions/direction.h"

namespace gonio {

struct ReceiverCell {
    double theta_min_deg = 0, theta_max_deg = 0;  // 0 <= theta_min < theta_max <= 90
    double phi_min_deg = 0, phi_max_deg = 0;      // phi_min < phi_max <= phi_min + 360
    bool operator==(const ReceiverCell&) const = default;
};

// The middle of the bounds in theta and phi; the pole for a cap.
AnglesDeg centre(const ReceiverCell& cell);
std::vector<AnglesDeg> centres(std::span<const ReceiverCell> cells);
double solid_angle(const ReceiverCell& cell);            // sr
double projected_solid_angle(const ReceiverCell& cell);  // integral of cos theta, sr; pi over the hemisphere
// The direction at (u, v) in the unit square, uniform in projected solid angle for uniform u, v.
Vec3 direction_in(const ReceiverCell& cell, double u, double v);

// The 145 patches whose centres klems_full() lists (gonio_grid.h), in that order.
std::vector<ReceiverCell> klems_full_cells();
// n >= 1 cells of projected solid angle pi / n each: about sqrt(n / pi) rings of nearly square sectors, from
// the pole outwards, azimuths from 0 (Beckers and Beckers 2012, "A general rule for disk and hemisphere
// partition into equal-area cells", with ring counts rounded from the areas).
std::vector<ReceiverCell> equal_cells(int n);

// Which cell holds a direction, without trigonometry: guide tables over sin^2 theta and over a pseudo-angle
// (Chen and Asau 1974), then a comparison or two with the exact bounds.
class CellLocator {
  public:
    // cells: a partition of the hemisphere in the order of the two functions above (rings from the pole
    // outwards, sectors of one width in each, azimuth increasing).
    explicit CellLocator(std::span<const ReceiverCell> cells);
    // Of a unit vector with z > 0.
    int operator()(double x, double y) const {
        const double square = x * x + y * y;
        int r = ring_guide_[static_cast<int>(std::min(square, 1.0) * ring_steps)];
        while (square >= rings_[r].square_max && r + 1 < static_cast<int>(rings_.size())) ++r;
        const Ring& ring = rings_[r];
        if (ring.n == 1) return ring.first;
        const double angle = pseudo_angle(x, y);
        int k = ring.guide[static_cast<int>(angle * sector_steps)];
        while (k < ring.n && angle >= ring.bounds[k]) ++k;
        return ring.first + (k + ring.shift) % ring.n;
    }

  private:
    static constexpr int ring_steps = 4096, sector_steps = 64;
    // Increases from 0 to 4 with the azimuth, a diamond's perimeter in place of the circle's.
    static double pseudo_angle(double x, double y) {
        const double sum = std::abs(x) + std::abs(y);
        if (!(sum > 0)) return 0;
        const double p = y / sum;
        return x >= 0 ? (y >= 0 ? p : std::min(4 + p, last_angle)) : 2 - p;
    }
    static constexpr double last_angle = 4 - 1e-15;
    struct Ring {
        double square_max;           // of sin^2 theta
        int first, n;                // its cells
        int shift;                   // sector behind the last bound is (k + shift) mod n for k bounds passed
        std::vector<double> bounds;  // of its sectors as pseudo-angles, increasing, n
        std::vector<int> guide;      // bounds passed at the start of each step
    };
    std::vector<Ring> rings_;
    std::vector<int> ring_guide_;
};

}  // namespace gonio
