// Exact simplifications of a mixture.
#include <algorithm>

#include "material/material.h"

namespace gonio {
namespace {

// Pointwise, alike or by channel, constant or mapped.
template <class Combine>
Parameter combined(const Parameter& a, const Parameter& b, Combine&& combine) {
    const size_t n = std::max(a.n_channels(), b.n_channels());
    const Parameter& mapped = a.is_map() ? a : b;
    if (!mapped.is_map()) {
        std::vector<double> values(n);
        for (size_t c = 0; c < n; ++c) values[c] = combine(a.at(c, 0, 0), b.at(c, 0, 0));
        return values;
    }
    const int nx = mapped.map_nx, ny = mapped.map_ny;
    std::vector<float> values;
    values.reserve(n * static_cast<size_t>(nx) * ny);
    for (size_t c = 0; c < n; ++c)
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i)
                values.push_back(static_cast<float>(combine(a.at(c, i, j), b.at(c, i, j))));
    return Parameter::mapped(nx, ny, std::move(values));
}

}  // namespace

Material simplified(Material material) {
    std::vector<WeightedLobe> others;
    Parameter weight, reflected;  // of the Lambertian parts: sum of weights, sum of weight times albedo
    const auto sum = [](double a, double b) { return std::min(1.0, a + b); };
    for (WeightedLobe& part : material.lobes) {
        if (part.weight.range().second == 0 && material.lobes.size() > 1) continue;
        const auto* lambertian = std::get_if<Lambertian>(&part.lobe);
        if (!lambertian) {
            others.push_back(std::move(part));
            continue;
        }
        const Parameter product =
            combined(part.weight, lambertian->albedo, [](double w, double albedo) { return w * albedo; });
        weight = weight.empty() ? part.weight : combined(weight, part.weight, sum);
        reflected = reflected.empty() ? product : combined(reflected, product, sum);
    }
    if (others.empty())
        others.push_back({1.0, Lambertian{reflected.empty() ? Parameter(0.0) : std::move(reflected)}});
    else if (!reflected.empty())
        others.push_back({weight, Lambertian{combined(reflected, weight, [](double r, double w) {
                              return w > 0 ? std::min(1.0, r / w) : 0.0;
                          })}});
    material.lobes = std::move(others);
    return material;
}

}  // namespace gonio
