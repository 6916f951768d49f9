// [1] Ivanic & Ruedenberg 1996, "Rotation matrices for real spherical harmonics. Direct determination by
// recursion", J. Phys. Chem. 100,
//     with the corrections of 1998 (J. Phys. Chem. A 102). Band l comes from band 1 and band l - 1: table 1
//     gives u, v, w, table 2 gives U, V, W. Their harmonics have no Condon-Shortley phase, as ours.
#include "directions/harmonic_rotation.h"

#include <cmath>
#include <cstdlib>

#include "directions/spherical_harmonics.h"

namespace gonio {
namespace {

// A band's block, addressed by m' and m.
class Band {
  public:
    explicit Band(int l) : l_(l), entries_(static_cast<size_t>(2 * l + 1) * (2 * l + 1)) {}
    double& operator()(int row, int column) { return entries_[index(row, column)]; }
    double operator()(int row, int column) const { return entries_[index(row, column)]; }
    int l() const { return l_; }
    std::vector<double> take() { return std::move(entries_); }

  private:
    size_t index(int row, int column) const {
        return static_cast<size_t>(row + l_) * (2 * l_ + 1) + static_cast<size_t>(column + l_);
    }
    int l_;
    std::vector<double> entries_;
};

// Band 1 is the matrix itself, for y_1m runs as (y, z, x).
Band first_band(const Rotation& rotation) {
    const auto component = [](const Vec3& v, int m) { return m < 0 ? v.y : m == 0 ? v.z : v.x; };
    Band band(1);
    for (int m = -1; m <= 1; ++m) {
        band(-1, m) = component(rotation.rows[1], m);
        band(0, m) = component(rotation.rows[2], m);
        band(1, m) = component(rotation.rows[0], m);
    }
    return band;
}

// P of table 2.
double p(int i, int a, int b, int l, const Band& first, const Band& before) {
    if (b == l) return first(i, 1) * before(a, l - 1) - first(i, -1) * before(a, 1 - l);
    if (b == -l) return first(i, 1) * before(a, 1 - l) + first(i, -1) * before(a, l - 1);
    return first(i, 0) * before(a, b);
}

double entry(int m, int n, int l, const Band& first, const Band& before) {
    const int am = std::abs(m);
    const double denominator = std::abs(n) < l ? 1.0 * (l + n) * (l - n) : 2.0 * l * (2 * l - 1);
    const double u = std::sqrt((l + m) * (l - m) / denominator);
    const double v =
        0.5 * std::sqrt((m == 0 ? 2 : 1) * (l + am - 1.0) * (l + am) / denominator) * (m == 0 ? -1 : 1);
    const double w = m == 0 ? 0 : -0.5 * std::sqrt((l - am - 1.0) * (l - am) / denominator);
    const auto P = [&](int i, int a) { return p(i, a, n, l, first, before); };
    double sum = 0;
    if (u != 0) sum += u * P(0, m);
    if (v != 0) {
        if (m == 0)
            sum += v * (P(1, 1) + P(-1, -1));
        else if (m > 0)
            sum += v * (m == 1 ? std::sqrt(2.0) * P(1, 0) : P(1, m - 1) - P(-1, 1 - m));
        else
            sum += v * (m == -1 ? std::sqrt(2.0) * P(-1, 0) : P(1, m + 1) + P(-1, -m - 1));
    }
    if (w != 0) sum += w * (m > 0 ? P(1, m + 1) + P(-1, -m - 1) : P(1, m - 1) - P(-1, 1 - m));
    return sum;
}

}  // namespace

Rotation rotation_around(const Vec3& axis, double angle) {
    const double c = std::cos(angle), s = std::sin(angle), t = 1 - c;
    const auto& [x, y, z] = axis;
    return {{{{t * x * x + c, t * x * y - s * z, t * x * z + s * y},
              {t * x * y + s * z, t * y * y + c, t * y * z - s * x},
              {t * x * z - s * y, t * y * z + s * x, t * z * z + c}}}};
}

std::vector<std::vector<double>> sh_rotation(int order, const Rotation& rotation) {
    std::vector<std::vector<double>> blocks{{1.0}};
    const Band first = first_band(rotation);
    Band before = first;
    for (int l = 1; l < order; ++l) {
        Band band = first;
        if (l > 1) {
            band = Band(l);
            for (int m = -l; m <= l; ++m)
                for (int n = -l; n <= l; ++n) band(m, n) = entry(m, n, l, first, before);
        }
        before = band;
        blocks.push_back(band.take());
    }
    return blocks;
}

std::vector<double> rotate_sh(int order, std::span<const double> coefficients, const Rotation& rotation) {
    std::vector<double> rotated(coefficients.size());
    const std::vector<std::vector<double>> blocks = sh_rotation(order, rotation);
    for (int l = 0; l < order; ++l) {
        const int width = 2 * l + 1, first = l * l;
        for (int row = 0; row < width; ++row)
            for (int column = 0; column < width; ++column)
                rotated[first + row] += blocks[l][row * width + column] * coefficients[first + column];
    }
    return rotated;
}

std::vector<double> rotate_around_z(int order, std::span<const double> coefficients, double angle) {
    std::vector<double> rotated(coefficients.begin(), coefficients.end());
    for (int m = 1; m < order; ++m) {
        const double c = std::cos(m * angle), s = std::sin(m * angle);
        for (int l = m; l < order; ++l) {
            const double cosine = coefficients[harmonic_index(l, m)],
                         sine = coefficients[harmonic_index(l, -m)];
            rotated[harmonic_index(l, m)] = c * cosine - s * sine;
            rotated[harmonic_index(l, -m)] = s * cosine + c * sine;
        }
    }
    return rotated;
}

}  // namespace gonio
