#include "material/lobe_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/numeric.h"

namespace gonio {
namespace {

constexpr double lambertian_width = 0.5;  // albedo / pi = albedo / (4 pi width^2)

double mean(const Parameter& p) {
    if (p.is_map())
        return std::accumulate(p.map.begin(), p.map.end(), 0.0) / static_cast<double>(p.map.size());
    return std::accumulate(p.constant.begin(), p.constant.end(), 0.0) /
           static_cast<double>(p.constant.size());
}

double smallest(const Parameter& p) {
    return p.range().first;
}

// Fresnel at normal incidence.
double reflected_along_normal(double eta, double k) {
    return ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
}

double share_of(const SpecularReflectance& specular) {
    return specular.fresnel() ? reflected_along_normal(mean(specular.eta), mean(specular.k))
                              : mean(specular.reflectance);
}

struct Shapes {
    std::vector<LobeShape> operator()(const Lambertian& lobe) const {
        return {{mean(lobe.albedo), lambertian_width}};
    }
    std::vector<LobeShape> operator()(const Phong& lobe) const {
        // (n + 2) / (2 pi); the largest exponent is the narrowest.
        return {{mean(lobe.albedo), std::sqrt(0.5 / (lobe.exponent.range().second + 2))}};
    }
    std::vector<LobeShape> operator()(const BlinnPhong& lobe) const {
        const double n = lobe.exponent.range().second;
        return {{mean(lobe.albedo), std::sqrt(2 * (std::pow(2.0, -n / 2) + n) / ((n + 2) * (n + 4)))}};
    }
    std::vector<LobeShape> operator()(const Microfacet& lobe) const {
        return {{share_of(lobe.reflectance), std::sqrt(smallest(lobe.alpha_x) * smallest(lobe.alpha_y))}};
    }
    std::vector<LobeShape> operator()(const CoatedDiffuse& lobe) const {
        const double coat = reflected_along_normal(mean(lobe.eta), 0);
        return {{coat, smallest(lobe.alpha)}, {(1 - coat) * mean(lobe.albedo), lambertian_width}};
    }
    std::vector<LobeShape> operator()(const Mirror& lobe) const { return {{share_of(lobe.reflectance), 0}}; }
};

}  // namespace

std::vector<LobeShape> lobe_shapes(const Material& material) {
    std::vector<LobeShape> shapes;
    for (const WeightedLobe& part : material.lobes)
        for (LobeShape shape : std::visit(Shapes{}, part.lobe)) {
            shape.share *= mean(part.weight);
            if (shape.share > 0) shapes.push_back(shape);
        }
    return shapes;
}

double reflected_share(const Material& material) {
    double sum = 0;
    for (const LobeShape& shape : lobe_shapes(material)) sum += shape.share;
    return sum;
}

double highest_peak(const Material& material) {
    double peak = 0;
    for (const LobeShape& shape : lobe_shapes(material))
        peak += shape.width > 0 ? shape.share / (4 * pi * shape.width * shape.width)
                                : std::numeric_limits<double>::infinity();
    return peak;
}

}  // namespace gonio
