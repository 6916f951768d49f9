// J. F. Blinn, "Models of light reflection for computer synthesized pictures", 1977; normalised at normal
// incidence, where the integral of cos^n(theta_h) cos_o is 8 pi (2^(-n/2) + n) / ((n + 2) (n + 4)).
#include <algorithm>

#include "material/lobes.h"
#include "material/local_frame.h"

namespace gonio {

void add_f(const BlinnPhong& lobe, Cell cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f) {
    const double n = lobe.exponent.at(0, cell.i, cell.j),
                 norm = (n + 2) * (n + 4) / (8 * pi * (std::exp2(-n / 2) + n)),
                 shape = norm * std::pow(half_vector(wi, wo).z, n);
    for (size_t c = 0; c < f.size(); ++c)
        f[c] += weight.at(c, cell.i, cell.j) * lobe.albedo.at(c, cell.i, cell.j) * shape;
}

// Half vectors have density (n + 1) / (2 pi) cos^n, 4 <wo, h> is the Jacobian of mirroring.
double pdf(const BlinnPhong& lobe, Cell cell, const Vec3& wo, const Vec3& wi) {
    const double n = lobe.exponent.at(0, cell.i, cell.j);
    const Vec3 h = half_vector(wi, wo);
    return (n + 1) / (2 * pi) * std::pow(h.z, n) / (4 * dot(wo, h));
}

Vec3 sample(const BlinnPhong& lobe, Cell cell, const Vec3& wo, double u1, double u2) {
    const double n = lobe.exponent.at(0, cell.i, cell.j);
    const double z = std::pow(1 - u1, 1 / (n + 1)), r = safe_sqrt(1 - z * z), phi = 2 * pi * u2;
    const Vec3 h{r * std::cos(phi), r * std::sin(phi), z};
    if (dot(wo, h) <= 0) return {0, 0, -1};  // a half vector that wo does not see
    return mirrored(wo, h);
}

double reflected(const BlinnPhong& lobe, Cell cell, size_t channel, double) {
    return lobe.albedo.at(channel, cell.i, cell.j);
}

}  // namespace gonio
