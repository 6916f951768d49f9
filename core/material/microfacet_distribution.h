// Normals of a rough facet, anisotropic, with the masking of E. Heitz, "Understanding the masking-shadowing
// function in microfacet-based BRDFs", 2014. Directions in the facet's frame.
#pragma once
#include "directions/direction.h"
#include "material/material.h"

namespace gonio {

struct MicrofacetDistribution {
    Microfacet::Distribution kind = Microfacet::Distribution::ggx;
    double alpha_x = 1, alpha_y = 1;

    double density(const Vec3& h) const;  // D, per solid angle of normals; integral of D cos is 1
    double lambda(const Vec3& w) const;   // Smith's, w.z > 0
    double visible_share(const Vec3& w) const { return 1 / (1 + lambda(w)); }  // G1
    // Height-correlated G2 of light and view.
    double visible_share(const Vec3& wi, const Vec3& wo) const { return 1 / (1 + lambda(wi) + lambda(wo)); }
    // A normal out of those that wo sees: density G1 D <wo, h> / wo.z.
    Vec3 sample_visible(const Vec3& wo, double u1, double u2) const;

    // D G2 / (4 cos_i cos_o): the lobe of facets that reflect everything, in 1/sr.
    double lobe(const Vec3& wi, const Vec3& wo, const Vec3& h) const {
        return density(h) * visible_share(wi, wo) / (4 * wi.z * wo.z);
    }
    // Of wi = wo mirrored at sample_visible(wo): 4 <wo, h> is the Jacobian.
    double pdf(const Vec3& wo, const Vec3& h) const { return density(h) * visible_share(wo) / (4 * wo.z); }
};

}  // namespace gonio
