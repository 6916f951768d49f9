#include "directions/spherical_harmonics.h"

#include <cmath>
#include <numbers>
#include <numeric>

namespace gonio {

// Fully normalised recurrence: nothing grows or underflows, unlike with factorials. sin^m(theta) is taken out
// of P_l^m and goes with the azimuth as Re, Im (x + i y)^m, so that the poles are like any other place and no
// trigonometric function is called.
void sh_basis(int order, const Vec3& w, std::span<double> y) {
    double sectoral = std::sqrt(1 / (4 * pi));  // K_m^m P_m^m / sin^m(theta)
    double re = 1, im = 0;                      // (x + i y)^m
    for (int m = 0; m < order; ++m) {
        if (m > 0) {
            sectoral *= std::sqrt((2 * m + 1) / (2.0 * m));
            const double next = re * w.x - im * w.y;
            im = re * w.y + im * w.x;
            re = next;
        }
        const double scale = m == 0 ? 1 : std::numbers::sqrt2;
        double before = 0, legendre = sectoral;
        for (int l = m;;) {
            y[harmonic_index(l, m)] = scale * legendre * re;
            if (m > 0) y[harmonic_index(l, -m)] = scale * legendre * im;
            if (++l >= order) break;
            const double a = std::sqrt((4.0 * l * l - 1) / (1.0 * l * l - m * m));
            const double b = std::sqrt((1.0 * (l - 1) * (l - 1) - m * m) / (4.0 * (l - 1) * (l - 1) - 1));
            const double next = a * (w.z * legendre - b * before);
            before = legendre;
            legendre = next;
        }
    }
}

void hsh_basis(int order, const Vec3& w, std::span<double> y) {
    // cos theta' = 2 cos theta - 1 at the same azimuth: the sine is 2 sqrt(z (1 - z)), and (x, y) has the
    // length sqrt((1 - z) (1 + z)).
    const double z = std::max(w.z, 0.0), stretch = 2 * std::sqrt(z / (1 + z));
    sh_basis(order, {w.x * stretch, w.y * stretch, 2 * z - 1}, y);
    for (int k = 0; k < harmonic_count(order); ++k) y[k] *= std::numbers::sqrt2;
}

double sh_value(int order, std::span<const double> coefficients, const Vec3& w) {
    std::vector<double> y(harmonic_count(order));
    sh_basis(order, w, y);
    return std::inner_product(y.begin(), y.end(), coefficients.begin(), 0.0);
}

std::vector<double> cosine_lobe_eigenvalues(int order, double exponent) {
    std::vector<double> eigenvalues(order, 1.0);
    if (order > 1) eigenvalues[1] = (exponent + 1) / (exponent + 2);
    for (int l = 2; l < order; ++l)
        eigenvalues[l] = eigenvalues[l - 2] * (exponent - l + 2) / (exponent + l + 1);
    return eigenvalues;
}

std::vector<double> zonal_lobe(std::span<const double> eigenvalues, const Vec3& axis) {
    const int order = static_cast<int>(eigenvalues.size());
    std::vector<double> coefficients(harmonic_count(order));
    sh_basis(order, axis, coefficients);
    for (int l = 0; l < order; ++l)
        for (int m = -l; m <= l; ++m) coefficients[harmonic_index(l, m)] *= eigenvalues[l];
    return coefficients;
}

}  // namespace gonio
