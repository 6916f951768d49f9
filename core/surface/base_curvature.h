// The curved base that a relief stands on (Heidrich et al. 2000, sec. 5): constant principal curvatures, and
// every point of the relief sees its neighbours as from the top of that base. A point of the relief at base
// distance d along a horizontal unit direction s and at height h stands, in the tangent frame of the point at
// the origin, at
//     (R + h) sin(d / R) along s,  (R + h) cos(d / R) - R up,     1 / R = kappa_n(s) = kappa_1 cos^2 +
//     kappa_2 sin^2 (Euler).
// Exact for a sphere and along the principal directions of a cylinder. At oblique azimuths of any other base
// a geodesic also twists, by (kappa_1 - kappa_2) sin cos per length: a point of height h is misplaced
// sideways by that times h d.
#pragma once
#include <cmath>

namespace gonio {

// How it is found what the bent base hides.
enum class BaseCorrection {
    none,    // rays are bent: nothing is assumed
    exact,   // what a flat base hides stays hidden: its horizons are corrected, exactly (Onoue, Max, Nishita 2004) ...
    printed  // ... or as printed there, to first order; and scattering directions move with their ends (Heidrich et al. 2000)
};

struct BaseCurvature {
    double kappa_1 = 0, kappa_2 = 0;  // 1/m; above 0 convex (the normals fan out), below 0 hollow
    double direction = 0;             // of kappa_1, radians from x

    BaseCorrection correction = BaseCorrection::none;

    bool is_curved() const { return kappa_1 != 0 || kappa_2 != 0; }
    bool is_round() const { return kappa_1 == kappa_2; }  // a sphere, or flat: every azimuth is alike
    bool bends_rays() const { return is_curved() && correction == BaseCorrection::none; }
    bool corrects_horizons() const { return is_curved() && correction != BaseCorrection::none; }
    bool operator==(const BaseCurvature&) const = default;

    // Second fundamental form K in the frame of the grid.
    struct Tensor {
        double xx = 0, xy = 0, yy = 0;
    };
    Tensor tensor() const {
        const double c = std::cos(direction), s = std::sin(direction);
        return {kappa_1 * c * c + kappa_2 * s * s, (kappa_1 - kappa_2) * s * c,
                kappa_1 * s * s + kappa_2 * c * c};
    }
    // Normal curvature along a horizontal direction of any length above 0. Exactly 0 where nothing but
    // rounding bends.
    double along(double x, double y) const {
        const Tensor k = tensor();
        const double kappa = (k.xx * x * x + 2 * k.xy * x * y + k.yy * y * y) / (x * x + y * y);
        return std::abs(kappa) < 1e-12 * (std::abs(kappa_1) + std::abs(kappa_2)) ? 0 : kappa;
    }
    // The same base with x and y exchanged.
    BaseCurvature axes_swapped() const {
        BaseCurvature swapped = *this;
        swapped.direction = std::acos(0.0) - direction;
        return swapped;
    }
};

}  // namespace gonio
