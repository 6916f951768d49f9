// Normal distribution functions. D(m) in 1/sr is the area of facets with normal m per unit solid angle and
// per unit of base plane, so that the integral of D(m) cos(theta_m) over the hemisphere is 1. [1] Walter et
// al. 2007, "Microfacet models for refraction through rough surfaces"  [2] Heitz 2014, "Understanding the
// masking-shadowing function".
//
// A facet of a height field stands on base area, so facets counted by base area follow D cos(theta) d(omega),
// and their slopes (p, q) = (dh/dx, dh/dy) follow D cos^4(theta) dp dq [2, eq. 9]: Beckmann is a normal
// distribution of slopes, GGX a Student t with two degrees of freedom.
#pragma once
#include "directions/direction.h"

namespace gonio {

enum class NdfModel { beckmann, ggx };
inline const char* name_of(NdfModel model) {
    return model == NdfModel::beckmann ? "beckmann" : "ggx";
}

// alpha_x along the axis `rotation` (radians, from +x towards +y), alpha_y across it; both > 0.
struct NdfShape {
    NdfModel model = NdfModel::beckmann;
    double alpha_x = 0, alpha_y = 0, rotation = 0;
};

// D(m) [1/sr]; m a unit vector. 0 at and below the horizon for Beckmann, below it for GGX.
double ndf_value(const NdfShape& shape, const Vec3& m);

// theta_m (radians) below which the share u in [0, 1) of the base plane lies; isotropic.
double ndf_inverse_cdf(NdfModel model, double alpha, double u);

}  // namespace gonio
