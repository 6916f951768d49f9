#include "material/lobes.h"
#include "material/local_frame.h"
#include "material/microfacet_distribution.h"

namespace gonio {
namespace {

MicrofacetDistribution distribution(const Microfacet& lobe, Cell cell) {
    return {lobe.distribution, lobe.alpha_x.at(0, cell.i, cell.j), lobe.alpha_y.at(0, cell.i, cell.j)};
}

}  // namespace

void add_f(const Microfacet& lobe, Cell cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f) {
    const Vec3 h = half_vector(wi, wo);
    const double shape = distribution(lobe, cell).lobe(wi, wo, h), cos_h = dot(wi, h);
    for (size_t c = 0; c < f.size(); ++c)
        f[c] += weight.at(c, cell.i, cell.j) * reflectance(lobe.reflectance, cell, c, cos_h) * shape;
}

double pdf(const Microfacet& lobe, Cell cell, const Vec3& wo, const Vec3& wi) {
    return distribution(lobe, cell).pdf(wo, half_vector(wi, wo));
}

Vec3 sample(const Microfacet& lobe, Cell cell, const Vec3& wo, double u1, double u2) {
    return mirrored(wo, distribution(lobe, cell).sample_visible(wo, u1, u2));
}

double reflected(const Microfacet& lobe, Cell cell, size_t channel, double cos_o) {
    return reflectance(lobe.reflectance, cell, channel, cos_o);
}

}  // namespace gonio
