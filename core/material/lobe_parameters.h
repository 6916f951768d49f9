// The parameters of every lobe with their names and what they may be: one list for checks, for hashes and for
// maps.
#pragma once
#include <type_traits>

#include "material/material.h"

namespace gonio {

struct ParameterRange {
    double low, high;
    bool by_channel;  // may differ between channels
};

inline constexpr ParameterRange share_range{0, 1, true};
inline constexpr ParameterRange exponent_range{0, 1e6, false};
// Below that a lobe is narrower than the rounding of directions: a mirror.
inline constexpr ParameterRange alpha_range{1e-6, 1, false};
inline constexpr ParameterRange rotation_range{-360, 360, false};
inline constexpr ParameterRange coat_eta_range{1, 1e6, false};
inline constexpr ParameterRange metal_eta_range{1e-6, 1e6, true};
inline constexpr ParameterRange metal_k_range{0, 1e6, true};

// visit(name, parameter, range) for each parameter in use. Lobe: const or not.
template <class Reflectance, class Visit>
void visit_specular(Reflectance& specular, Visit&& visit) {
    if (specular.fresnel()) {
        visit("eta", specular.eta, metal_eta_range);
        visit("k", specular.k, metal_k_range);
    } else {
        visit("reflectance", specular.reflectance, share_range);
    }
}

template <class AnyLobe, class Visit>
void visit_parameters(AnyLobe& lobe, Visit&& visit) {
    using Kind = std::remove_const_t<AnyLobe>;
    if constexpr (std::is_same_v<Kind, Lambertian>) {
        visit("albedo", lobe.albedo, share_range);
    } else if constexpr (std::is_same_v<Kind, Phong> || std::is_same_v<Kind, BlinnPhong>) {
        visit("exponent", lobe.exponent, exponent_range);
        visit("albedo", lobe.albedo, share_range);
    } else if constexpr (std::is_same_v<Kind, Microfacet>) {
        visit("alpha_x", lobe.alpha_x, alpha_range);
        visit("alpha_y", lobe.alpha_y, alpha_range);
        visit("rotation_deg", lobe.rotation_deg, rotation_range);
        visit_specular(lobe.reflectance, visit);
    } else if constexpr (std::is_same_v<Kind, CoatedDiffuse>) {
        visit("eta", lobe.eta, coat_eta_range);
        visit("alpha", lobe.alpha, alpha_range);
        visit("albedo", lobe.albedo, share_range);
    } else {
        static_assert(std::is_same_v<Kind, Mirror>);
        visit_specular(lobe.reflectance, visit);
    }
}

}  // namespace gonio
