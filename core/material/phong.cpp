// E. P. Lafortune, Y. D. Willems, "Using the modified Phong reflectance model for physically based
// rendering", 1994.
#include <algorithm>

#include "material/lobes.h"

namespace gonio {
namespace {

double cos_to_mirrored(const Vec3& wi, const Vec3& wo) {
    return std::clamp(wi.z * wo.z - wi.x * wo.x - wi.y * wo.y, 0.0, 1.0);
}

}  // namespace

void add_f(const Phong& lobe, Cell cell, const Parameter& weight, const Vec3& wi, const Vec3& wo,
           std::span<double> f) {
    const double n = lobe.exponent.at(0, cell.i, cell.j),
                 shape = (n + 2) / (2 * pi) * std::pow(cos_to_mirrored(wi, wo), n);
    for (size_t c = 0; c < f.size(); ++c)
        f[c] += weight.at(c, cell.i, cell.j) * lobe.albedo.at(c, cell.i, cell.j) * shape;
}

double pdf(const Phong& lobe, Cell cell, const Vec3& wo, const Vec3& wi) {
    const double n = lobe.exponent.at(0, cell.i, cell.j);
    return (n + 1) / (2 * pi) * std::pow(cos_to_mirrored(wi, wo), n);
}

// About the mirrored direction with density cos^n.
Vec3 sample(const Phong& lobe, Cell cell, const Vec3& wo, double u1, double u2) {
    const double n = lobe.exponent.at(0, cell.i, cell.j);
    const double z = std::pow(1 - u1, 1 / (n + 1)), r = safe_sqrt(1 - z * z), phi = 2 * pi * u2;
    const Vec3 axis{-wo.x, -wo.y, wo.z};
    // Any two directions across the axis: Duff et al. 2017; axis.z > 0.
    const double a = -1 / (1 + axis.z), b = axis.x * axis.y * a;
    const Vec3 s{1 + axis.x * axis.x * a, b, -axis.x}, t{b, 1 + axis.y * axis.y * a, -axis.y};
    const double x = r * std::cos(phi), y = r * std::sin(phi);
    return {s.x * x + t.x * y + axis.x * z, s.y * x + t.y * y + axis.y * z, s.z * x + t.z * y + axis.z * z};
}

double reflected(const Phong& lobe, Cell cell, size_t channel, double) {
    return lobe.albedo.at(channel, cell.i, cell.j);
}

}  // namespace gonio
