// Rotation of SH coefficients: the rotated function f'(w) = f(R^-1 w) has the coefficients M c, band by band.
#pragma once
#include <array>
#include <span>
#include <vector>

#include "directions/direction.h"

namespace gonio {

// Rows of a matrix that turns vectors: R w = (rows[0] . w, rows[1] . w, rows[2] . w).
struct Rotation {
    std::array<Vec3, 3> rows;

    Vec3 operator()(const Vec3& w) const { return {dot(rows[0], w), dot(rows[1], w), dot(rows[2], w)}; }
};

// Right-handed turn by `angle` (radians) around a unit axis.
Rotation rotation_around(const Vec3& axis, double angle);

// One (2l + 1) x (2l + 1) block a band below `order`, [m' + l][m + l] row by row. Error of the entries at
// order 32: below 1e-13 (orthogonality and agreement with evaluated harmonics;
// tests/unit/spherical_harmonics_test.cpp).
std::vector<std::vector<double>> sh_rotation(int order, const Rotation& rotation);

// M c. coefficients: order^2 of them.
std::vector<double> rotate_sh(int order, std::span<const double> coefficients, const Rotation& rotation);

// The same for a turn around z by `angle`: for SH and HSH alike, cheap and exact.
std::vector<double> rotate_around_z(int order, std::span<const double> coefficients, double angle);

}  // namespace gonio
