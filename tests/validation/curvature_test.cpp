// Horizons on a curved base against the displaced columns of data/curvature_columns.json.
#include "visibility/curvature.h"

#include <gtest/gtest.h>

#include <cmath>

#include "validation/reference_data.h"

namespace gonio {
namespace {

// Columns of radius 5 on a square lattice of 16, seen along x: their near rims.
struct Rim {
    double distance, height;
};
std::vector<Rim> rims_along_x(const std::vector<double>& heights, double x, double y, double reach) {
    std::vector<Rim> rims;
    const double off = y - 16 * (std::floor(y / 16) + 0.5);
    if (std::abs(off) >= 5) return rims;
    const double half = std::sqrt(25 - off * off);
    for (int i = static_cast<int>(std::floor(x / 16)); 16 * (i + 0.5) - half - x < reach; ++i) {
        const double distance = 16 * (i + 0.5) - half - x;
        if (distance > 0) rims.push_back({distance, heights[i % heights.size()]});
    }
    return rims;
}

double degrees_of(double slope) {
    return degrees(std::atan(slope));
}

TEST(CurvatureColumns, SingleOccluders) {
    const auto document = reference::load_json("curvature_columns");
    for (const auto& e : document.at("single_occluder_entries")) {
        const double slope = e.at("tan_b_flat"), distance = e.at("arc_distance_d"),
                     height = e.at("h_receiver"), kappa = e.at("kappa");
        EXPECT_NEAR(bent_horizon_slope(slope, distance, height, kappa), e.at("tan_b_exact").get<double>(),
                    1e-10);
        EXPECT_NEAR(bent_horizon_slope(slope, distance, height, kappa, HorizonCorrection::printed),
                    e.at("formula_h_is_occluder_height").get<double>(), 1e-10);
    }
    for (const auto& e : document.at("terminator_entries"))
        EXPECT_NEAR(terminator_slope(e.at("h_receiver"), e.at("kappa")),
                    e.at("tan_b_terminator").get<double>(), 1e-10);
}

// Where the flat horizon is the bent one's occluder, the exact form is exact.
TEST(CurvatureColumns, Entries) {
    const auto document = reference::load_json("curvature_columns");
    int other_occluder = 0;
    for (const auto& e : document.at("entries")) {
        const double distance = e.at("distance").is_null() ? 0 : e.at("distance").get<double>();
        const double found = corrected_horizon_slope(e.at("tan_horizon_flat"), distance, 0, e.at("kappa"));
        const double off = e.at("tan_horizon_exact_curved").get<double>() - found;
        EXPECT_GE(off, -1e-9);
        other_occluder += off > 1e-9;
    }
    EXPECT_LE(other_occluder, 6) << "of 150: only columns of unequal height hide each other differently";
}

// All ground points of the 128 x 128 map, along the curvature: rms within 1.2 times what the file states for
// the printed form with the occluder's height; the exact form is better than that.
TEST(CurvatureColumns, StatisticsOverTheMap) {
    const auto document = reference::load_json("curvature_columns");
    int tables = 0;
    for (const auto& s : document.at("statistics")) {
        if (s.at("phi_deg") != 0) continue;
        ++tables;
        const std::vector<double> heights = s.at("heights");
        const double kappa = s.at("kappa"), stated = s.at("occluder_height").at("rms_deg");
        double printed = 0, exact = 0;
        int n = 0;
        for (int a = 0; a < 128; ++a)
            for (int b = 0; b < 128; ++b) {
                const double x = a + 0.5, y = b + 0.5;
                if (std::hypot(std::fmod(x, 16) - 8, std::fmod(y, 16) - 8) < 5) continue;
                double truth = 0;
                Rim flat{0, 0};
                for (const Rim& rim : rims_along_x(heights, x, y, pi / 2 / kappa)) {
                    if (rim.height * flat.distance >= flat.height * rim.distance) flat = rim;
                    const double turn = kappa * rim.distance, r = 1 / kappa + rim.height;
                    truth = std::max(truth, (r * std::cos(turn) - 1 / kappa) / (r * std::sin(turn)));
                }
                auto off = [&](HorizonCorrection form) {
                    const double slope = flat.distance > 0 ? flat.height / flat.distance : 0;
                    return degrees_of(corrected_horizon_slope(slope, flat.distance, 0, kappa, form)) -
                           degrees_of(truth);
                };
                printed += std::pow(off(HorizonCorrection::printed), 2);
                exact += std::pow(off(HorizonCorrection::exact), 2);
                ++n;
            }
        EXPECT_LT(std::sqrt(printed / n), 1.2 * stated);
        EXPECT_GT(std::sqrt(printed / n), 0.8 * stated);
        EXPECT_LT(exact, printed);
    }
    EXPECT_EQ(tables, 6);
}

}  // namespace
}  // namespace gonio
