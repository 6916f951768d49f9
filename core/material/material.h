// Reflectance of the facets: a weighted sum of lobes out of a closed variant. A new one is a struct here, a
// file that evaluates and samples it, an entry in the variant, and its parameters in lobe_parameters.h.
#pragma once
#include <string>
#include <variant>
#include <vector>

#include "material/parameter.h"

namespace gonio {

// f_micro = albedo / pi.
struct Lambertian {
    Parameter albedo;  // [0, 1]
};

// Lafortune & Willems 1994: f_micro = albedo (exponent + 2) / (2 pi) cos^exponent(angle between wo and the
// mirrored wi).
struct Phong {
    Parameter exponent, albedo;
};

// f_micro = albedo (n + 2) (n + 4) / (8 pi (2^(-n/2) + n)) cos^n(angle between n and the half vector): at
// normal incidence it reflects just `albedo`.
struct BlinnPhong {
    Parameter exponent, albedo;
};

// What a specular facet reflects: a number that does not depend on the angle, or Fresnel's equations for the
// complex index eta + i k of a metal.
struct SpecularReflectance {
    Parameter reflectance;  // [0, 1]
    Parameter eta, k;       // used if given
    bool fresnel() const { return !eta.empty(); }
};

// F D G2 / (4 cos_i cos_o) with height-correlated Smith masking. alpha_x along the tangent, which
// rotation_deg turns from the direction of x towards that of y.
struct Microfacet {
    enum class Distribution { beckmann, ggx };
    Distribution distribution = Distribution::ggx;
    Parameter alpha_x, alpha_y, rotation_deg = 0.0;
    SpecularReflectance reflectance;
};

// A rough dielectric (GGX) over a Lambertian base.
struct CoatedDiffuse {
    Parameter eta, alpha, albedo;
};

struct Mirror {
    SpecularReflectance reflectance;
};

using Lobe = std::variant<Lambertian, Phong, BlinnPhong, Microfacet, CoatedDiffuse, Mirror>;

struct WeightedLobe {
    Parameter weight;  // [0, 1]; their sum is at most 1 in each channel of each cell
    Lobe lobe;
};

// Shapes (exponent, alpha, rotation, the index of a coat) are the same for all channels; what is reflected
// may differ.
struct Material {
    std::vector<std::string> channels;  // "y", or "r" "g" "b", or "450nm" ...
    std::vector<WeightedLobe> lobes;    // one of weight 1, or a mixture (nested ones are flattened)

    Material() = default;
    Material(std::vector<std::string> names, Lobe lobe)
        : channels(std::move(names)), lobes{{1.0, std::move(lobe)}} {}
};

// The albedo of a material that is Lambertian and nothing else, with a value or a plane for each channel;
// else null. Mixtures of Lambertians are so after simplified().
const Lambertian* pure_lambertian(const Material& material);

// The same material in fewest lobes: one for all Lambertian parts, of weight 1 if there are no others;
// none of weight 0.
Material simplified(Material material);

// Throws Error("/material/...") for values that are not allowed, for numbers of channels that do not fit, or
// a map of another size than nx x ny.
void validate(const Material& material, int nx, int ny);

}  // namespace gonio
