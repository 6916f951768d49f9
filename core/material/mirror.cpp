#include "material/fresnel.h"
#include "material/lobes.h"

namespace gonio {

double reflectance(const SpecularReflectance& specular, Cell cell, size_t channel, double cos_theta) {
    if (!specular.fresnel()) return specular.reflectance.at(channel, cell.i, cell.j);
    return fresnel_conductor(cos_theta, specular.eta.at(channel, cell.i, cell.j),
                             specular.k.at(channel, cell.i, cell.j));
}

void add_f(const Mirror&, Cell, const Parameter&, const Vec3&, const Vec3&, std::span<double>) {}

double pdf(const Mirror&, Cell, const Vec3&, const Vec3&) {
    return 0;
}

Vec3 sample(const Mirror&, Cell, const Vec3& wo, double, double) {
    return {-wo.x, -wo.y, wo.z};
}

double reflected(const Mirror& lobe, Cell cell, size_t channel, double cos_o) {
    return reflectance(lobe.reflectance, cell, channel, cos_o);
}

}  // namespace gonio
