// Receiver cells: they partition the hemisphere, and a direction is found in the cell whose bounds hold it.
#include "directions/cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/random.h"
#include "directions/gonio_grid.h"

namespace gonio {
namespace {

bool holds(const ReceiverCell& cell, double theta_deg, double phi_deg, double margin_deg) {
    double turn = std::fmod(phi_deg - cell.phi_min_deg, 360);
    if (turn < -margin_deg) turn += 360;
    const double width = cell.phi_max_deg - cell.phi_min_deg;
    return theta_deg >= cell.theta_min_deg - margin_deg && theta_deg <= cell.theta_max_deg + margin_deg &&
           (turn <= width + margin_deg || turn >= 360 - margin_deg || theta_deg < margin_deg);
}

std::vector<std::vector<ReceiverCell>> partitions() {
    std::vector<std::vector<ReceiverCell>> list{klems_full_cells()};
    for (const int n : {1, 2, 3, 7, 8, 64, 100, 1000, 12345}) list.push_back(equal_cells(n));
    return list;
}

TEST(Cells, PartitionTheHemisphere) {
    for (const std::vector<ReceiverCell>& cells : partitions()) {
        double solid = 0, projected = 0;
        for (const ReceiverCell& c : cells) solid += solid_angle(c), projected += projected_solid_angle(c);
        EXPECT_NEAR(solid, 2 * pi, 1e-12 * static_cast<double>(cells.size()));
        EXPECT_NEAR(projected, pi, 1e-12 * static_cast<double>(cells.size()));
    }
    for (const int n : {1, 2, 3, 7, 8, 64, 100, 1000, 12345}) {
        const std::vector<ReceiverCell> cells = equal_cells(n);
        ASSERT_EQ(cells.size(), static_cast<size_t>(n));
        for (const ReceiverCell& c : cells) EXPECT_NEAR(projected_solid_angle(c), pi / n, 1e-11 * pi / n);
    }
    EXPECT_THROW(equal_cells(0), Error);
}

TEST(Cells, KlemsCellsLieAroundTheKlemsDirections) {
    const std::vector<ReceiverCell> cells = klems_full_cells();
    EXPECT_EQ(centres(cells), klems_full());
    // Projected solid angles of the basis as its XML files are read (Radiance bsdf.c): pi (sin^2 b - sin^2 a)
    // / n.
    EXPECT_NEAR(projected_solid_angle(cells[0]), pi * std::pow(std::sin(radians(5)), 2), 1e-12);
    EXPECT_NEAR(projected_solid_angle(cells[144]), pi / 12 * (1 - std::pow(std::sin(radians(75)), 2)), 1e-12);
}

TEST(Cells, ADirectionIsFoundInTheCellThatHoldsIt) {
    for (const std::vector<ReceiverCell>& cells : partitions()) {
        const CellLocator locator(cells);
        for (uint64_t k = 0; k < 20000; ++k) {
            const auto words = random_words(3, 1, k);
            const double square = uniform_double(words[0]), phi = 360 * uniform_double(words[1]) - 180;
            const double sine = std::sqrt(square);
            const int found = locator(sine * std::cos(radians(phi)), sine * std::sin(radians(phi)));
            ASSERT_GE(found, 0);
            ASSERT_LT(found, static_cast<int>(cells.size()));
            ASSERT_TRUE(holds(cells[found], degrees(std::asin(sine)), phi, 1e-7))
                << cells.size() << " " << square << " " << phi;
        }
        // The corners of the domain: pole, horizon, axes, either zero.
        for (const double x : {-1.0, -0.0, 0.0, 1.0})
            for (const double y : {-1.0, -0.0, 0.0, 1.0}) {
                const double length = std::max(1.0, std::hypot(x, y));
                const int found = locator(x / length, y / length);
                ASSERT_GE(found, 0);
                ASSERT_LT(found, static_cast<int>(cells.size()));
                ASSERT_TRUE(holds(cells[found], degrees(std::asin(std::min(1.0, std::hypot(x, y)))),
                                  degrees(std::atan2(y, x)), 1e-7));
            }
    }
}

TEST(Cells, DirectionsInACellAreUniformInProjectedSolidAngle) {
    const std::vector<ReceiverCell> cells = klems_full_cells();
    const CellLocator locator(cells);
    for (const size_t k : {size_t{0}, size_t{1}, size_t{40}, size_t{144}}) {
        // Halves in u and v hold half the projected solid angle each: bounds of the quarter come back as
        // corners.
        const ReceiverCell& c = cells[k];
        double sum = 0;
        for (int a = 0; a < 16; ++a)
            for (int b = 0; b < 16; ++b) {
                const Vec3 d = direction_in(c, (a + 0.5) / 16, (b + 0.5) / 16);
                EXPECT_NEAR(dot(d, d), 1, 1e-12);
                EXPECT_EQ(locator(d.x, d.y), static_cast<int>(k));
                sum += d.x * d.x + d.y * d.y;
            }
        // Mean of sin^2 theta weighted by the cosine: the middle of its bounds.
        const double low = std::pow(std::sin(radians(c.theta_min_deg)), 2),
                     high = std::pow(std::sin(radians(c.theta_max_deg)), 2);
        EXPECT_NEAR(sum / 256, 0.5 * (low + high), 1e-12);
    }
}

}  // namespace
}  // namespace gonio
