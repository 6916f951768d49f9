#include "material/facet_brdf.h"

#include <algorithm>

#include "base/error.h"
#include "surface/facet_mesh.h"

namespace gonio {

FacetBrdf::FacetBrdf(const Material& material, const HeightField& surface, int kind, int i, int j)
    : material_(material), i_(i), j_(j) {
    const Gradient g = facet_gradient(surface, kind, i, j);
    const double z = 1 / area_ratio(g);
    normal_ = {-g.x * z, -g.y * z, z};
    if (!pure_lambertian(material))
        throw Error(ErrorCode::invalid_input, "/material", "", "only Lambertian facets so far");
}

void FacetBrdf::eval(const Vec3& wi, const Vec3& wo, std::span<double> f) const {
    std::fill(f.begin(), f.end(), 0.0);
    if (!(dot(normal_, wi) > 0 && dot(normal_, wo) > 0)) return;
    for (size_t c = 0; c < f.size(); ++c) f[c] = pure_lambertian(material_)->albedo.at(c, i_, j_) / pi;
}

double FacetBrdf::pdf(const Vec3& wo, const Vec3& wi) const {
    return dot(normal_, wo) > 0 ? std::max(0.0, dot(normal_, wi)) / pi : 0.0;
}

std::optional<FacetBrdf::Sample> FacetBrdf::sample(const Vec3& wo, double, double u1, double u2,
                                                   std::span<double> weight) const {
    if (!(dot(normal_, wo) > 0)) return std::nullopt;
    const double z = 1 - 2 * u1, r = safe_sqrt(1 - z * z), phi = 2 * pi * u2;
    const Vec3 d{normal_.x + r * std::cos(phi), normal_.y + r * std::sin(phi), normal_.z + z};
    const double length = std::sqrt(dot(d, d));
    if (length < 1e-9) return std::nullopt;
    const Vec3 wi{d.x / length, d.y / length, d.z / length};
    for (size_t c = 0; c < weight.size(); ++c) weight[c] = pure_lambertian(material_)->albedo.at(c, i_, j_);
    return Sample{wi, pdf(wo, wi), false};
}

bool FacetBrdf::has_delta() const {
    return false;
}
bool FacetBrdf::has_density() const {
    return true;
}

}  // namespace gonio
