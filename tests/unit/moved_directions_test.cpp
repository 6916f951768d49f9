// Scattering by the flat relief's visibility and moved directions: what a wall of a groove sees of the other
// one, on a cylinder along the groove, against the integral over the displaced walls.
#include "scattering/moved_directions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "surface/generate.h"
#include "visibility/curvature.h"

namespace gonio {
namespace {

// Mean over the walls of the share of the light of the other wall that arrives (K applied to 1).
double seen_share(const BaseCurvature& base, int n, int n_directions) {
    HeightField surface = generate_v_groove(n, n, 45);
    surface.base = base;
    const MarchGrid grid = make_march_grid(surface);
    const Tile tile = make_tile(surface, {0, 0, n, surface.ny}, {0, 0, n, surface.ny}, 1);
    const double z_max = grid.max_slope / std::sqrt(1 + grid.max_slope * grid.max_slope);
    std::vector<SubSample> jitter;
    for (int i = 0; i < n_directions; ++i)
        jitter.push_back(
            {fractional_part(0.3 + 0.7548776662466927 * i), fractional_part(0.6 + 0.5698402909980532 * i)});
    const LinkOperator op =
        build_link_operator(grid, tile, slab_directions(n_directions, z_max, 0.3, 0.7), jitter, 1, {});
    double sum = 0, area = 0;
    for (const float root : tile.sqrt_area) area += root * root;
    for (const LinkOperator::Chunk& chunk : op.chunks)
        for (size_t r = 0; r + 1 < chunk.records.size(); ++r)
            for (uint32_t k = chunk.records[r].begin; k < chunk.records[r + 1].begin; ++k)
                sum += 2 * chunk.links[k].weight * tile.sqrt_area[chunk.records[r].unknown] *
                       tile.sqrt_area[chunk.links[k].seen];
    return sum / area;
}

// The same of the displaced walls, long along the groove: the integral of cos cos / (2 r) over both (Hottel's
// two-dimensional form factor), everything that the flat groove shows counted. Crests are at -n/2 and n/2,
// the bottom at 0, the mean height half-way.
double seen_share_of_displaced_walls(double kappa, int n) {
    constexpr int pieces = 400;
    struct Piece {
        Vec3 middle, normal;
        double length;
    };
    auto wall = [&](double side) {
        auto at = [&](int k) {
            const double share = static_cast<double>(k) / pieces;
            return displaced_position({kappa, 0, 0}, side * 0.5 * n * share, 0, n * (0.5 * share - 0.25));
        };
        std::vector<Piece> pieces_of_wall;
        for (int k = 0; k < pieces; ++k) {
            const Vec3 a = at(k), b = at(k + 1);
            const double x = b.x - a.x, z = b.z - a.z, length = std::hypot(x, z);
            pieces_of_wall.push_back(
                {{(a.x + b.x) / 2, 0, (a.z + b.z) / 2}, {-side * z / length, 0, side * x / length}, length});
        }
        return pieces_of_wall;
    };
    const std::vector<Piece> left = wall(-1), right = wall(1);
    double sum = 0, length = 0;
    for (const Piece& p : right) {
        length += p.length;
        for (const Piece& q : left) {
            const double x = q.middle.x - p.middle.x, z = q.middle.z - p.middle.z, r = std::hypot(x, z);
            const double leave = (x * p.normal.x + z * p.normal.z) / r,
                         arrive = -(x * q.normal.x + z * q.normal.z) / r;
            if (leave > 0 && arrive > 0) sum += leave * arrive / (2 * r) * p.length * q.length;
        }
    }
    return sum / length;
}

TEST(MovedDirections, AWallSeesOfTheOtherWhatItsDisplacedShapeSays) {
    constexpr int n = 64, n_directions = 1024;
    const double flat = seen_share({}, n, n_directions);
    EXPECT_NEAR(flat, 1 - std::sqrt(0.5), 0.004);
    for (const double kappa : {0.01, -0.008}) {
        BaseCurvature base{kappa, 0, 0};
        base.correction = BaseCorrection::exact;
        const double seen = seen_share(base, n, n_directions),
                     expected = seen_share_of_displaced_walls(kappa, n);
        std::printf("kappa %g: %.4f, expected %.4f, flat %.4f\n", kappa, seen, expected, flat);
        EXPECT_NEAR(seen - flat, expected - (1 - std::sqrt(0.5)),
                    0.15 * std::abs(expected - (1 - std::sqrt(0.5))));
    }
}

}  // namespace
}  // namespace gonio
