#include <algorithm>

#include "material/lobes.h"

namespace gonio {

// A point of the unit disk, lifted to the hemisphere.
Vec3 cosine_sample(double u1, double u2) {
    const double r = std::sqrt(u1), phi = 2 * pi * u2;
    return {r * std::cos(phi), r * std::sin(phi), safe_sqrt(1 - u1)};
}

void add_f(const Lambertian& lobe, Cell cell, const Parameter& weight, const Vec3&, const Vec3&,
           std::span<double> f) {
    for (size_t c = 0; c < f.size(); ++c)
        f[c] += weight.at(c, cell.i, cell.j) * lobe.albedo.at(c, cell.i, cell.j) / pi;
}

double pdf(const Lambertian&, Cell, const Vec3&, const Vec3& wi) {
    return std::max(0.0, wi.z) / pi;
}

Vec3 sample(const Lambertian&, Cell, const Vec3&, double u1, double u2) {
    return cosine_sample(u1, u2);
}

double reflected(const Lambertian& lobe, Cell cell, size_t channel, double) {
    return lobe.albedo.at(channel, cell.i, cell.j);
}

}  // namespace gonio
