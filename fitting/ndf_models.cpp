#include "fitting/ndf_models.h"

namespace gonio {

double ndf_value(const NdfShape& shape, const Vec3& m) {
    const double c = std::cos(shape.rotation), s = std::sin(shape.rotation);
    const double x = (c * m.x + s * m.y) / shape.alpha_x, y = (c * m.y - s * m.x) / shape.alpha_y;
    const double norm = pi * shape.alpha_x * shape.alpha_y, zz = m.z * m.z;
    if (shape.model == NdfModel::beckmann)
        return m.z <= 0 ? 0 : std::exp(-(x * x + y * y) / zz) / (norm * zz * zz);
    const double q = x * x + y * y + zz;
    return m.z < 0 ? 0 : 1 / (norm * q * q);
}

double ndf_inverse_cdf(NdfModel model, double alpha, double u) {
    // tan^2(theta) / alpha^2 is exponential (Beckmann) or log-logistic (GGX) [1, eqs. 28 and 35]; log1p keeps
    // small u exact.
    return std::atan(alpha * std::sqrt(model == NdfModel::beckmann ? -std::log1p(-u) : u / (1 - u)));
}

}  // namespace gonio
