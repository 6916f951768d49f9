// The hull sweep against the march over all edges of the mesh, which march_test holds against a scalar walk.
#include "visibility/horizon_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "surface/generate.h"
#include "visibility/horizon_sweep.h"
#include "visibility/march.h"

namespace gonio {
namespace {

const Monitor no_monitor;

struct Difference {
    double rms_rad = 0;   // of the elevation
    double above = 0;     // most that the sweep's slope is above the march's, relative
    double wrong = 0;     // share of receivers whose elevation is off by more than 5e-3 rad
    double distance = 0;  // share of those within 1e-5 rad whose horizon is another one, > 2 cells away
};

Difference compare(const MarchGrid& grid, double azimuth, const FacetPoint& receiver,
                   double smallest_slope = HorizonOptions().smallest_slope) {
    const HorizonSlice sweep = compute_horizon(grid, azimuth, receiver, {.smallest_slope = smallest_slope}),
                       march = compute_horizon(grid, azimuth, receiver, {.exact = true});
    Difference d;
    const double n = static_cast<double>(sweep.slope.size());
    double squares = 0, right = 0, apart = 0;
    for (size_t k = 0; k < sweep.slope.size(); ++k) {
        const double error =
            std::atan(static_cast<double>(sweep.slope[k])) - std::atan(static_cast<double>(march.slope[k]));
        squares += error * error;
        d.above = std::max(d.above, (static_cast<double>(sweep.slope[k]) - march.slope[k]) /
                                        (1 + static_cast<double>(march.slope[k])));
        d.wrong += std::abs(error) > 5e-3 ? 1 / n : 0;
        if (std::abs(error) < 1e-5) {
            ++right;
            apart += std::abs(sweep.distance[k] - march.distance[k]) > 2;
        }
    }
    d.rms_rad = std::sqrt(squares / n);
    d.distance = apart / right;
    return d;
}

std::vector<FacetPoint> receivers() {
    return {node_receiver, {0, 2.0 / 3, 1.0 / 3}, {1, 1.0 / 3, 2.0 / 3}, facet_point(1, 0.9, 0.05)};
}

HeightField white_noise(int nx, int ny, double pitch_y, double height, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, height);
    std::vector<double> heights(static_cast<size_t>(nx) * ny);
    for (double& h : heights) h = uniform(random);
    return make_height_field(nx, ny, 1, pitch_y, heights);
}

// All eight octants, the axes and the diagonals.
const std::vector<double> azimuths_deg{0,   11,  45,  57,  90,  101, 135, 153,
                                       180, 200, 225, 247, 270, 290, 315, 342};

TEST(HorizonSweep, SmoothFieldsWithinAThousandthOfARadian) {
    for (const auto& [nx, ny, slope] :
         std::vector<std::tuple<int, int, double>>{{128, 128, 0.7}, {96, 160, 0.3}, {140, 40, 0.7}}) {
        const MarchGrid grid = make_march_grid(generate_gaussian(nx, ny, 1, 8, slope, 5));
        ASSERT_TRUE(can_sweep(grid));
        for (const FacetPoint& receiver : receivers())
            for (const double azimuth_deg : azimuths_deg) {
                const Difference d = compare(grid, radians(azimuth_deg), receiver);
                const auto where = ::testing::Message() << nx << " " << azimuth_deg << " " << receiver.u;
                EXPECT_LT(d.rms_rad, 1e-3) << where;
                EXPECT_LT(d.above, 3e-5) << where << ": it only takes true points of the relief";
                EXPECT_LT(d.wrong, 0.01) << where;
                EXPECT_LT(d.distance, 0.002) << where;
            }
    }
}

// Without correlation no neighbour's horizon is one's own: the worst case of the two lines beside.
TEST(HorizonSweep, WhiteNoiseAndOblongCellsStayBelowTheMarch) {
    for (const double pitch_y : {1.0, 3.0, 0.2}) {
        const MarchGrid grid = make_march_grid(white_noise(64, 48, pitch_y, 2, 8));
        for (const FacetPoint& receiver : receivers())
            for (const double azimuth_deg : azimuths_deg) {
                const Difference d = compare(grid, radians(azimuth_deg), receiver);
                const auto where = ::testing::Message() << pitch_y << " " << azimuth_deg << " " << receiver.u;
                EXPECT_LT(d.above, 3e-5) << where;
                EXPECT_LT(d.rms_rad, pitch_y < 1 ? 0.06 : 0.03) << where;  // slopes up to 10, or 2
            }
    }
}

// Towards +-x from the nodes the lines are the nodes' own rays: nothing is missed.
TEST(HorizonSweep, ExactAlongTheAxes) {
    const MarchGrid grid = make_march_grid(white_noise(64, 48, 2, 3, 9));
    for (const double azimuth_deg : {0.0, 90.0, 180.0, 270.0}) {
        const Difference d = compare(grid, radians(azimuth_deg), node_receiver, 1e-3);
        EXPECT_LT(d.rms_rad, 1e-6) << azimuth_deg;
        EXPECT_LT(d.distance, 0.003) << azimuth_deg << ": ties, to rounding";
    }
}

TEST(HorizonMap, ASpikeAndItsImages) {
    constexpr int n = 64;
    std::vector<double> heights(n * n, 0.0);
    heights[20 * n + 10] = 5;
    const MarchGrid grid = make_march_grid(make_height_field(n, n, 0.5, 0.5, heights));
    for (const bool exact : {false, true}) {
        const HorizonSlice east = compute_horizon(grid, 0, node_receiver, {.exact = exact});
        for (int i = 0; i < n; ++i) {
            if (i == 10) continue;                           // its image is as high as itself
            const int cells = i < 10 ? 10 - i : n + 10 - i;  // to the spike, or to its next image
            EXPECT_NEAR(east.slope[20 * n + i], 5 / (0.5 * cells), 1e-5) << i;
            EXPECT_NEAR(east.distance[20 * n + i], 0.5 * cells, 1e-4) << i;
            EXPECT_EQ(east.slope[23 * n + i], 0) << i;
            EXPECT_EQ(east.distance[23 * n + i], 0) << i;
        }
        // An image three periods away, seen between the others: along (3, 1) periods from a node on its line.
        const double azimuth = std::atan2(1.0, 3.0);
        const HorizonSlice far =
            compute_horizon(grid, azimuth, node_receiver, {.exact = exact, .smallest_slope = 0.01});
        EXPECT_NEAR(far.slope[20 * n + 10], 0, 1e-6) << "nothing stands above the spike";
        const double travel = std::hypot(3 * n - 3, n - 1) * 0.5;
        EXPECT_NEAR(far.slope[21 * n + 13], 5 / travel, 1e-5);
    }
}

TEST(HorizonMap, FlatTinyAndTowering) {
    for (const auto& [nx, ny] : {std::pair{1, 1}, {1, 50}, {70, 1}, {3, 5}, {32, 32}, {33, 200}})
        for (const bool exact : {false, true})
            for (const double azimuth_deg : azimuths_deg) {
                const std::vector<double> flat(static_cast<size_t>(nx) * ny, 7.0);
                const MarchGrid grid = make_march_grid(make_height_field(nx, ny, 1, 2, flat));
                const HorizonSlice slice =
                    compute_horizon(grid, radians(azimuth_deg), {0, 0.6, 0.2}, {.exact = exact});
                for (const float slope : slice.slope) ASSERT_EQ(slope, 0);
                ASSERT_EQ(slice.distance.size(), flat.size());
            }
    std::vector<double> tower(40 * 36, 0.0);
    tower[100] = 1e8;
    const MarchGrid grid = make_march_grid(make_height_field(40, 36, 1, 1, tower));
    const HorizonSlice slice = compute_horizon(grid, 0.5, node_receiver, {});
    for (const float slope : slice.slope) EXPECT_TRUE(std::isfinite(slope) && slope >= 0);
}

TEST(HorizonMap, SameBitsForAnyNumberOfThreads) {
    const MarchGrid grid = make_march_grid(generate_gaussian(64, 64, 1, 6, 0.7, 3));
    const std::vector<double> azimuths = uniform_azimuths(8, 0.3);
    const HorizonMap one = make_horizon_map(grid, azimuths, {0, 0.6, 0.3}, {}, 1, no_monitor),
                     many = make_horizon_map(grid, azimuths, {0, 0.6, 0.3}, {}, 5, no_monitor);
    for (int k = 0; k < 8; ++k) {
        EXPECT_EQ(one.slices[k].slope, many.slices[k].slope);
        EXPECT_EQ(one.slices[k].distance, many.slices[k].distance);
    }
}

TEST(HorizonMap, InstructionSetsAgree) {
    const MarchGrid grid = make_march_grid(generate_gaussian(96, 72, 1, 6, 0.7, 3));
    std::vector<HorizonSlice> slices;
    for (const char* target : {"SSE4", "AVX2", "AVX3"})
        if (force_simd_target(target)) slices.push_back(compute_horizon(grid, 0.7, {0, 0.6, 0.3}, {}));
    force_simd_target("");
    ASSERT_FALSE(slices.empty());
    for (const HorizonSlice& slice : slices) {
        int apart = 0;
        for (size_t k = 0; k < slice.slope.size(); ++k)
            apart += std::abs(slice.slope[k] - slices[0].slope[k]) > 1e-5f;
        EXPECT_LE(apart, 3) << "ties of the hull may be broken either way by rounding";
    }
}

}  // namespace
}  // namespace gonio
