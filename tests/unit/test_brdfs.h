// Analytic reflectances of shared/performance_techniques 5, to project: a broad lobe on a diffuse base, a
// narrower one, a lobe that the horizon cuts, and one of kinks.
#pragma once
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "table/table.h"

namespace gonio::test {

struct TestBrdf {
    std::string name;
    double (*f)(const Vec3& wi, const Vec3& wo);
};

inline double ggx(const Vec3& wi, const Vec3& wo, double alpha) {
    const Vec3 sum{wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    const double c2 = sum.z * sum.z / dot(sum, sum), tan2 = (1 - c2) / c2;
    const double d = alpha * alpha / (pi * c2 * c2 * std::pow(alpha * alpha + tan2, 2));
    const auto lambda = [alpha](double z) {
        return (std::sqrt(1 + alpha * alpha * (1 - z * z) / (z * z)) - 1) / 2;
    };
    return d / ((1 + lambda(wi.z) + lambda(wo.z)) * 4 * wi.z * wo.z);
}

inline double oren_nayar(const Vec3& wi, const Vec3& wo) {
    constexpr double s2 = 0.25, a = 1 - 0.5 * s2 / (s2 + 0.33), b = 0.45 * s2 / (s2 + 0.09);
    const double ti = std::acos(wi.z), to = std::acos(wo.z);
    const double cos_phi = (wi.x * wo.x + wi.y * wo.y) / std::max(1e-9, std::sin(ti) * std::sin(to));
    return (a + b * std::max(0.0, cos_phi) * std::sin(std::max(ti, to)) * std::tan(std::min(ti, to))) / pi;
}

inline const std::vector<TestBrdf>& test_brdfs() {
    static const std::vector<TestBrdf> brdfs = {
        {"GGX 0.5 + 0.3 / pi", [](const Vec3& wi, const Vec3& wo) { return ggx(wi, wo, 0.5) + 0.3 / pi; }},
        {"GGX 0.3", [](const Vec3& wi, const Vec3& wo) { return ggx(wi, wo, 0.3); }},
        {"Phong 20",
         [](const Vec3& wi, const Vec3& wo) {
             const double c = wi.z * wo.z - wi.x * wo.x - wi.y * wo.y;
             return 22 / (2 * pi) * std::pow(std::max(0.0, c), 20);
         }},
        {"Oren-Nayar 0.5", oren_nayar},
    };
    return brdfs;
}

// f where the table's directions say, without errors.
template <class F>
void fill(Table& table, const F& f) {
    table.channels = {"y"};
    table.f.resize(table.rows());
    table.se.assign(table.rows(), 0);
    table.bias.assign(table.rows(), 0);
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        table.f[row] = static_cast<float>(f(to_vector(table.incident[i]), to_vector(table.outgoing[o])));
    }
}

}  // namespace gonio::test
