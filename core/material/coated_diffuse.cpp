// A rough dielectric (GGX) over a Lambertian base, light between base and coat to all orders: of what the
// base sends up, the share mean_transmittance / eta^2 leaves (Helmholtz), the rest comes back to it evenly.
#include "material/coat.h"
#include "material/fresnel.h"
#include "material/lobes.h"
#include "material/local_frame.h"
#include "material/microfacet_distribution.h"

namespace gonio {
namespace {

struct Coat {
    double eta, alpha;

    Coat(const CoatedDiffuse& lobe, Cell cell)
        : eta(lobe.eta.at(0, cell.i, cell.j)), alpha(lobe.alpha.at(0, cell.i, cell.j)) {}
    MicrofacetDistribution normals() const { return {Microfacet::Distribution::ggx, alpha, alpha}; }
    double transmittance(double cos_theta) const { return coat_transmittance(eta, alpha, cos_theta); }
    double base(double albedo) const { return coat_base_factor(eta, alpha, albedo); }
};

// Of sampling the coat rather than the base.
double coat_odds(const Coat& coat, const CoatedDiffuse& lobe, Cell cell, double cos_o) {
    const double reflected = fresnel_dielectric(cos_o, coat.eta);
    double albedo = 0;
    for (size_t c = 0; c < lobe.albedo.n_channels(); ++c)
        albedo = std::max(albedo, lobe.albedo.at(c, cell.i, cell.j));
    const double from_base = (1 - reflected) * albedo;
    return reflected + from_base > 0 ? reflected / (reflected + from_base) : 0.0;
}

}  // namespace

void add_f(const CoatedDiffuse& lobe, Cell cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f) {
    const Coat coat(lobe, cell);
    const Vec3 h = half_vector(wi, wo);
    const double specular = fresnel_dielectric(dot(wi, h), coat.eta) * coat.normals().lobe(wi, wo, h),
                 through = coat.transmittance(wi.z) * coat.transmittance(wo.z) / pi;
    for (size_t c = 0; c < f.size(); ++c)
        f[c] += weight.at(c, cell.i, cell.j) *
                (specular + through * coat.base(lobe.albedo.at(c, cell.i, cell.j)));
}

double pdf(const CoatedDiffuse& lobe, Cell cell, const Vec3& wo, const Vec3& wi) {
    const Coat coat(lobe, cell);
    const double odds = coat_odds(coat, lobe, cell, wo.z);
    return odds * coat.normals().pdf(wo, half_vector(wi, wo)) + (1 - odds) * wi.z / pi;
}

Vec3 sample(const CoatedDiffuse& lobe, Cell cell, const Vec3& wo, double u1, double u2) {
    const Coat coat(lobe, cell);
    const double odds = coat_odds(coat, lobe, cell, wo.z);
    if (u1 >= odds) return cosine_sample((u1 - odds) / (1 - odds), u2);
    return mirrored(wo, coat.normals().sample_visible(wo, u1 / odds, u2));
}

double reflected(const CoatedDiffuse& lobe, Cell cell, size_t channel, double cos_o) {
    const double specular = fresnel_dielectric(cos_o, lobe.eta.at(0, cell.i, cell.j));
    return specular + (1 - specular) * lobe.albedo.at(channel, cell.i, cell.j);
}

}  // namespace gonio
