// Spherical and hemispherical harmonics, their rotation and the quadrature that judges them.
#include "directions/spherical_harmonics.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/random.h"
#include "directions/harmonic_rotation.h"
#include "directions/hemisphere_quadrature.h"

namespace gonio {
namespace {

Vec3 random_direction(uint64_t stream, uint64_t counter) {
    const auto words = random_words(17, stream, counter);
    const double z = 2 * uniform_double(words[0]) - 1, phi = 2 * pi * uniform_double(words[1]);
    return {safe_sqrt(1 - z * z) * std::cos(phi), safe_sqrt(1 - z * z) * std::sin(phi), z};
}

Rotation random_rotation(uint64_t k) {
    return rotation_around(random_direction(1, k), 2 * pi * uniform_double(random_words(17, 2, k)[0]));
}

Rotation product(const Rotation& a, const Rotation& b) {
    Rotation result;
    for (int r = 0; r < 3; ++r)
        result.rows[r] = {dot(a.rows[r], {b.rows[0].x, b.rows[1].x, b.rows[2].x}),
                          dot(a.rows[r], {b.rows[0].y, b.rows[1].y, b.rows[2].y}),
                          dot(a.rows[r], {b.rows[0].z, b.rows[1].z, b.rows[2].z})};
    return result;
}

std::vector<double> random_coefficients(int order, uint64_t stream) {
    std::vector<double> c(harmonic_count(order));
    for (size_t k = 0; k < c.size(); ++k) c[k] = uniform_double(random_words(17, stream, k)[0]) - 0.5;
    return c;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(a[k] - b[k]));
    return most;
}

// Largest |<y_a, y_b> - delta_ab| over the sphere (SH) or the upper hemisphere (HSH).
double orthonormality_error(int order, bool hemispherical) {
    const Quadrature z_rule = gauss_legendre(order, hemispherical ? 0 : -1, 1);
    const int n_phi = 2 * order, count = harmonic_count(order);
    Eigen::MatrixXd basis(n_phi * order, count);
    std::vector<double> y(count);
    for (int j = 0; j < order; ++j)
        for (int k = 0; k < n_phi; ++k) {
            const double z = z_rule.nodes[j], r = std::sqrt(1 - z * z), phi = 2 * pi * k / n_phi;
            const Vec3 w{r * std::cos(phi), r * std::sin(phi), z};
            hemispherical ? hsh_basis(order, w, y) : sh_basis(order, w, y);
            basis.row(j * n_phi + k) = Eigen::Map<Eigen::RowVectorXd>(y.data(), count) *
                                       std::sqrt(z_rule.weights[j] * 2 * pi / n_phi);
        }
    const Eigen::MatrixXd gram = basis.transpose() * basis;
    return (gram - Eigen::MatrixXd::Identity(count, count)).cwiseAbs().maxCoeff();
}

TEST(SphericalHarmonics, OrthonormalToOrder32) {
    for (const bool hemispherical : {false, true})
        for (const int order : {1, 2, 8, 32}) {
            const double error = orthonormality_error(order, hemispherical);
            RecordProperty((hemispherical ? "hsh_" : "sh_") + std::to_string(order),
                           std::to_string(error * 1e16));
            EXPECT_LT(error, 2e-14) << order << (hemispherical ? " HSH" : " SH");
        }
}

// Sum over m of y_lm(a) y_lm(b) = (2l + 1) / (4 pi) P_l(a . b): a relation between different directions,
// poles included.
TEST(SphericalHarmonics, AdditionTheorem) {
    constexpr int order = max_harmonic_order;
    std::vector<double> ya(harmonic_count(order)), yb(ya);
    for (int k = 0; k < 20; ++k) {
        const Vec3 a = k == 0 ? Vec3{0, 0, 1} : k == 1 ? Vec3{0, 0, -1} : random_direction(3, k);
        const Vec3 b = random_direction(4, k);
        sh_basis(order, a, ya);
        sh_basis(order, b, yb);
        for (int l = 0; l < order; ++l) {
            double sum = 0;
            for (int m = -l; m <= l; ++m) sum += ya[harmonic_index(l, m)] * yb[harmonic_index(l, m)];
            EXPECT_NEAR(sum, (2 * l + 1) / (4 * pi) * std::legendre(l, dot(a, b)), 1e-12) << "band " << l;
        }
    }
}

// An independent definition of the shifted functions: associated Legendre of 2 z - 1 from the standard
// library.
TEST(HemisphericalHarmonics, AreShiftedLegendreFunctions) {
    constexpr int order = 8;
    std::vector<double> y(harmonic_count(order));
    for (int k = 0; k < 50; ++k) {
        Vec3 w = random_direction(5, k);
        w.z = std::abs(w.z);
        hsh_basis(order, w, y);
        const double phi = std::atan2(w.y, w.x);
        for (int l = 0; l < order; ++l)
            for (int m = 0; m <= l; ++m) {
                const double norm =
                    std::sqrt((2 * l + 1) / (2 * pi) * std::tgamma(l - m + 1) / std::tgamma(l + m + 1));
                const double value =
                    (m == 0 ? 1 : std::sqrt(2)) * norm * std::assoc_legendre(l, m, 2 * w.z - 1);
                EXPECT_NEAR(y[harmonic_index(l, m)], value * std::cos(m * phi), 1e-12);
                EXPECT_NEAR(y[harmonic_index(l, -m)], value * (m == 0 ? 1 : std::sin(m * phi)), 1e-12);
            }
    }
}

TEST(HarmonicRotation, TurnsTheFunction) {
    constexpr int order = max_harmonic_order;
    const std::vector<double> c = random_coefficients(order, 6);
    for (int k = 0; k < 5; ++k) {
        const Rotation rotation = random_rotation(k);
        const std::vector<double> turned = rotate_sh(order, c, rotation);
        for (int d = 0; d < 10; ++d) {
            const Vec3 w = random_direction(7, 10 * k + d);
            EXPECT_NEAR(sh_value(order, turned, rotation(w)), sh_value(order, c, w),
                        1e-12 * std::sqrt(c.size()));
        }
    }
}

TEST(HarmonicRotation, EntriesAreExactToOrder32) {
    constexpr int order = max_harmonic_order;
    for (int k = 0; k < 3; ++k) {
        // M_ab = <y_a, y_b after the turn> by exact quadrature over the sphere.
        const Rotation rotation = random_rotation(20 + k);
        const std::vector<std::vector<double>> blocks = sh_rotation(order, rotation);
        const Quadrature z_rule = gauss_legendre(order, -1, 1);
        const int n_phi = 2 * order, count = harmonic_count(order);
        Eigen::MatrixXd turned(n_phi * order, count), fixed(n_phi * order, count);
        std::vector<double> y(count);
        for (int j = 0; j < order; ++j)
            for (int i = 0; i < n_phi; ++i) {
                const double z = z_rule.nodes[j], r = std::sqrt(1 - z * z), phi = 2 * pi * i / n_phi;
                const Vec3 w{r * std::cos(phi), r * std::sin(phi), z};
                sh_basis(order, rotation(w), y);
                turned.row(j * n_phi + i) = Eigen::Map<Eigen::RowVectorXd>(y.data(), count);
                sh_basis(order, w, y);
                fixed.row(j * n_phi + i) =
                    Eigen::Map<Eigen::RowVectorXd>(y.data(), count) * (z_rule.weights[j] * 2 * pi / n_phi);
            }
        double most = 0, most_across = 0;
        for (int l = 0; l < order; ++l) {
            const int width = 2 * l + 1, first = l * l;
            const Eigen::MatrixXd block =
                turned.middleCols(first, width).transpose() * fixed.middleCols(first, width);
            const Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> found(blocks[l].data(),
                                                                                         width, width);
            most = std::max(most, (block - found).cwiseAbs().maxCoeff());
            most_across = std::max(
                most_across, (found * found.transpose() - Eigen::MatrixXd::Identity(width, width)).norm());
        }
        EXPECT_LT(most, 1e-13);
        EXPECT_LT(most_across, 1e-12);
    }
}

TEST(HarmonicRotation, ComposesAndInverts) {
    constexpr int order = max_harmonic_order;
    const std::vector<double> c = random_coefficients(order, 8);
    const Rotation a = random_rotation(30), b = random_rotation(31);
    EXPECT_LT(
        largest_difference(rotate_sh(order, rotate_sh(order, c, b), a), rotate_sh(order, c, product(a, b))),
        1e-12);
    const Rotation there = rotation_around({0.6, 0, 0.8}, 1.1), back = rotation_around({0.6, 0, 0.8}, -1.1);
    EXPECT_LT(largest_difference(rotate_sh(order, rotate_sh(order, c, there), back), c), 1e-12);
    const Rotation around_z = rotation_around({0, 0, 1}, 0.7);
    EXPECT_LT(largest_difference(rotate_sh(order, c, around_z), rotate_around_z(order, c, 0.7)), 1e-12);
}

// What no rotation changes: the energy of each band.
TEST(HarmonicRotation, KeepsTheEnergyOfBands) {
    constexpr int order = max_harmonic_order;
    const std::vector<double> c = random_coefficients(order, 9),
                              turned = rotate_sh(order, c, random_rotation(40));
    for (int l = 0; l < order; ++l) {
        double before = 0, after = 0;
        for (int k = l * l; k < (l + 1) * (l + 1); ++k) before += c[k] * c[k], after += turned[k] * turned[k];
        EXPECT_NEAR(after, before, 1e-12 * before);
    }
}

TEST(HarmonicRotation, TurnsHemisphericalOnesAroundZ) {
    constexpr int order = 12;
    const std::vector<double> c = random_coefficients(order, 10), turned = rotate_around_z(order, c, 0.9);
    const Rotation rotation = rotation_around({0, 0, 1}, 0.9);
    std::vector<double> y(c.size()), y_turned(c.size());
    Vec3 w = random_direction(11, 0);
    w.z = std::abs(w.z);
    hsh_basis(order, w, y);
    hsh_basis(order, rotation(w), y_turned);
    double before = 0, after = 0;
    for (size_t k = 0; k < c.size(); ++k) before += c[k] * y[k], after += turned[k] * y_turned[k];
    EXPECT_NEAR(after, before, 1e-12);
}

TEST(ZonalHarmonics, LobeHasTheEigenvaluesOfItsAxis) {
    constexpr int order = 16;
    const Vec3 axis = random_direction(12, 1);
    const std::vector<double> eigenvalues = cosine_lobe_eigenvalues(order, 6),
                              lobe = zonal_lobe(eigenvalues, axis);
    // <lobe, y> by quadrature round the axis: cos^6 is cut at its own horizon.
    const DirectionSet cap = hemisphere_quadrature(24, 48);
    const Vec3 z{0, 0, 1};
    const Vec3 across{z.y * axis.z - z.z * axis.y, z.z * axis.x - z.x * axis.z, z.x * axis.y - z.y * axis.x};
    const double sine = std::sqrt(dot(across, across));
    const Rotation to_axis =
        rotation_around({across.x / sine, across.y / sine, across.z / sine}, std::acos(axis.z));
    std::vector<double> y(harmonic_count(order)), projected(y.size());
    for (size_t k = 0; k < cap.directions.size(); ++k) {
        sh_basis(order, to_axis(cap.directions[k]), y);
        const double value = 7 / (2 * pi) * std::pow(cap.directions[k].z, 6) * cap.solid_angle[k];
        for (size_t i = 0; i < y.size(); ++i) projected[i] += value * y[i];
    }
    EXPECT_LT(largest_difference(projected, lobe), 1e-13);
}

TEST(GaussLegendre, IntegratesMonomials) {
    for (const int n : {1, 2, 5, 32, 512}) {
        const Quadrature rule = gauss_legendre(n, 0, 1);
        for (const int degree : {0, 1, n, 2 * n - 1}) {
            double sum = 0;
            for (int k = 0; k < n; ++k) sum += rule.weights[k] * std::pow(rule.nodes[k], degree);
            EXPECT_NEAR(sum * (degree + 1), 1, 1e-12) << n << " nodes, degree " << degree;
        }
    }
}

}  // namespace
}  // namespace gonio
