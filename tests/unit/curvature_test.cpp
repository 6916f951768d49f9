// The geometry of a curved base against vectors on cylinders and spheres, and the march of bent rays against
// a walk along true positions.
#include "visibility/curvature.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "surface/facet_mesh.h"
#include "surface/generate.h"
#include "visibility/march.h"

namespace gonio {
namespace {

Vec3 minus(const Vec3& a, const Vec3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
void expect_near(const Vec3& a, const Vec3& b, double tolerance) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

// A cylinder around an axis at angle `axis` from y, unrolled: exact at any azimuth. Its top is the origin.
struct Cylinder {
    double kappa, direction;
    // Base offset (x, y) and height to space.
    Vec3 position(double x, double y, double h) const {
        const double c = std::cos(direction), s = std::sin(direction);
        const double across = c * x + s * y, along = -s * x + c * y, turn = kappa * across;
        const double out = (1 / kappa + h) * std::sin(turn);
        return {c * out - s * along, s * out + c * along, (1 / kappa + h) * std::cos(turn) - 1 / kappa};
    }
    BaseCurvature base() const { return {kappa, 0, direction}; }
};

TEST(BaseCurvature, FollowsEuler) {
    const BaseCurvature base{0.3, -0.1, radians(20)};
    EXPECT_NEAR(base.along(std::cos(radians(20)), std::sin(radians(20))), 0.3, 1e-15);
    EXPECT_NEAR(base.along(-std::sin(radians(20)), std::cos(radians(20))), -0.1, 1e-15);
    const double phi = radians(77);
    EXPECT_NEAR(
        base.along(3 * std::cos(phi), 3 * std::sin(phi)),
        0.3 * std::pow(std::cos(phi - radians(20)), 2) - 0.1 * std::pow(std::sin(phi - radians(20)), 2),
        1e-15);
    const BaseCurvature cylinder{0.02, 0, radians(30)};
    EXPECT_EQ(cylinder.along(-std::sin(radians(30)), std::cos(radians(30))), 0.0);
    EXPECT_NEAR(base.axes_swapped().along(std::sin(phi), std::cos(phi)),
                base.along(std::cos(phi), std::sin(phi)), 1e-15);
}

TEST(BaseCurvature, PositionsAreThoseOfSphereAndCylinder) {
    const double kappa = 0.04;
    for (const double h : {-2.0, 0.0, 3.0})
        for (const double d : {0.0, 0.5, 7.0, 25.0}) {
            const Cylinder cylinder{kappa, radians(35)};
            const double x = d * std::cos(radians(35)), y = d * std::sin(radians(35));
            expect_near(displaced_position(cylinder.base(), x, y, h), cylinder.position(x, y, h), 1e-12);
            expect_near(displaced_position(cylinder.base(), -y, x, h), cylinder.position(-y, x, h), 1e-12);
            // On a sphere every azimuth is alike.
            expect_near(displaced_position({kappa, kappa, 0.7}, x, y, h), cylinder.position(x, y, h), 1e-12);
        }
    // Elsewhere on a cylinder: to first order in kappa, but for the sideways shift kappa h d sin cos.
    const Cylinder cylinder{0.002, 0};
    const Vec3 exact = cylinder.position(6, 8, 0), ours = displaced_position(cylinder.base(), 6, 8, 0);
    EXPECT_LT(std::hypot(minus(exact, ours).x, minus(exact, ours).y), std::pow(0.002, 2) * 1000 / 6);
    EXPECT_NEAR(exact.z, ours.z, std::pow(0.002, 3) * 1e4);
    EXPECT_NEAR(exact.z, -0.002 * 36 / 2, 1e-6);
}

// Flat triangles between displaced nodes: exactly so on a cylinder, in the frame at the centroid; and
// together they are the displaced surface, whose parallel areas grow by I + h K.
TEST(BaseCurvature, FacetsAreThoseOfTheDisplacedMesh) {
    for (const double kappa : {0.02, -0.02}) {
        HeightField surface = generate_gaussian(16, 16, 1, 4, 0.7, 4);
        surface.base = {kappa, 0, 0};
        const Cylinder cylinder{kappa, 0};
        double area = 0, expected = 0;
        for (int j = 0; j < 16; ++j)
            for (int i = 0; i < 16; ++i)
                for (int kind = 0; kind < 2; ++kind) {
                    const double x = kind == 0 ? 2.0 / 3 : 1.0 / 3, y = 1 - x;
                    auto node = [&](int a, int b) {
                        return cylinder.position(a - x, b - y, surface.at(i + a, j + b));
                    };
                    const Vec3 a = minus(node(1, 1), node(0, 0)),
                               b = kind == 0 ? minus(node(1, 0), node(0, 0)) : minus(node(0, 1), node(0, 0));
                    const Vec3 n = kind == 0 ? cross(b, a) : cross(a, b);
                    const double length = std::sqrt(dot(n, n));
                    const DisplacedFacet facet = displaced_facet(surface, kind, i, j);
                    EXPECT_NEAR(facet.area / (0.5 * length), 1, 1e-9);
                    expect_near(facet.normal, {n.x / length, n.y / length, n.z / length}, 1e-9);
                    const Gradient g = facet_gradient(surface, kind, i, j);
                    const double stretch =
                        1 + kappa *
                                (surface.at(i, j) + surface.at(i + 1, j + 1) +
                                 (kind == 0 ? surface.at(i + 1, j) : surface.at(i, j + 1))) /
                                3.0;
                    area += facet.area;
                    expected += 0.5 * stretch * area_ratio({g.x / stretch, g.y});
                }
        EXPECT_NEAR(area / expected, 1, 2e-4);
    }
}

TEST(BaseCurvature, TurnsDirectionsWithTheNormal) {
    const double kappa = 0.03;
    const Cylinder cylinder{kappa, radians(25)};
    const Vec3 d = to_vector({50, 200});
    for (const auto& [x, y] : {std::pair{5.0, 0.0}, {3.0, -9.0}, {0.0, 20.0}}) {
        // The frame there, by differences of the base: exact for a cylinder at every azimuth.
        const double step = 1e-4;
        auto tangent = [&](double dx, double dy) {
            const Vec3 t = minus(cylinder.position(x + dx, y + dy, 0), cylinder.position(x - dx, y - dy, 0));
            return Vec3{t.x / (2 * step), t.y / (2 * step), t.z / (2 * step)};
        };
        const Vec3 ex = tangent(step, 0), ey = tangent(0, step), ez = cross(ex, ey);
        const Vec3 turned = turned_direction(d, cylinder.base(), x, y);
        expect_near(turned, {dot(d, ex), dot(d, ey), dot(d, ez)}, 1e-8);
        // On a sphere along the great circle.
        const double distance = std::hypot(x, y), turn = kappa * distance;
        expect_near(turned_direction({x / distance, y / distance, 0}, {kappa, kappa, 0}, x, y),
                    {std::cos(turn) * x / distance, std::cos(turn) * y / distance, std::sin(turn)}, 1e-12);
    }
    expect_near(turned_direction(d, {0, 0, 0}, 3, 4), d, 0);
}

TEST(BentHorizon, IsTheSlopeToTheDisplacedOccluder) {
    for (const double kappa : {0.02, 0.001, -0.01})
        for (const double height : {-1.0, 0.0, 2.0})
            for (const double distance : {0.3, 4.0, 30.0})
                for (const double slope : {-0.05, 0.2, 1.5}) {
                    const Vec3 q =
                        displaced_position({kappa, kappa, 0}, distance, 0, height + slope * distance);
                    EXPECT_NEAR(bent_horizon_slope(slope, distance, height, kappa), (q.z - height) / q.x,
                                1e-9 * (1 + std::abs(slope)));
                    // Eq. 2 is its expansion: what is left falls with the square of kappa.
                    auto left = [&](double k) {
                        return std::abs(
                            bent_horizon_slope(slope, distance, height, k) -
                            bent_horizon_slope(slope, distance, height, k, HorizonCorrection::printed));
                    };
                    EXPECT_LT(left(kappa * 1e-2), 1e-3 * left(kappa) + 1e-12);
                }
    EXPECT_EQ(bent_horizon_slope(0.7, 3, 1, 0), 0.7);
    // Where the tangent from above touches the base.
    const double turn = std::acos(1 / (1 + 0.1 * 2.0));
    EXPECT_NEAR(terminator_slope(2, 0.1), -std::tan(turn), 1e-12);
    EXPECT_EQ(terminator_slope(-1, 0.1), 0);
    EXPECT_EQ(corrected_horizon_slope(0, 0, 2, 0.1), terminator_slope(2, 0.1));
    EXPECT_EQ(corrected_horizon_slope(-0.25, 8, 2, 0.1), terminator_slope(2, 0.1));
    EXPECT_EQ(corrected_horizon_slope(0.3, 5, 2, -0.01), bent_horizon_slope(0.3, 5, 2, -0.01));
}

// Walks a ray over the facets in small steps of base distance and holds it against their displaced positions.
struct Walk {
    bool front = false, hit = false;
    int column = 0, row = 0, kind = 0;  // of the facet that is hit
    double clearance = 1e300;           // smallest distance to deciding otherwise, in pitch_x
};

class ArcWalk {
  public:
    explicit ArcWalk(const HeightField& surface) : s_(surface) {
        for (const float h : surface.heights) top_ = std::max<double>(top_, h);
    }

    double start_height(int column, int row, const FacetPoint& start) const {
        return height(start.kind, column, row, (column + start.u) * s_.pitch_x, (row + start.v) * s_.pitch_y);
    }

    // tolerance: a ray that is deeper below the relief than that need not be followed further. typical: of
    // the start heights, which decides how the way drifts across d.
    Walk trace(int column, int row, const FacetPoint& start, const Vec3& d, double tolerance,
               double typical) const {
        const double horizontal = std::hypot(d.x, d.y), ux = d.x / horizontal, uy = d.y / horizontal,
                     slope = d.z / horizontal, kappa = s_.base.along(ux, uy);
        const double x0 = (column + start.u) * s_.pitch_x, y0 = (row + start.v) * s_.pitch_y;
        const double h0 = height(start.kind, column, row, x0, y0);
        // A point of height h at base offset p stands h K p away from its foot, whose part across d the ray
        // cannot have.
        const BaseCurvature::Tensor k = s_.base.tensor();
        const double across = -(-uy * (k.xx * ux + k.xy * uy) + ux * (k.xy * ux + k.yy * uy));
        const Gradient g = facet_gradient(s_, start.kind, column, row);
        Walk walk;
        const double facing = slope * (1 + kappa * h0) -
                              (g.x * (ux - uy * across * typical) + g.y * (uy + ux * across * typical));
        walk.front = facing > 0;
        walk.clearance = std::abs(facing);
        if (!walk.front) return walk;
        constexpr double step = 0.01;
        const double quarter_turn = kappa == 0 ? 1e300 : pi / 2 / std::abs(kappa);
        double lowest = 1e300;  // of the ray above the relief
        for (double distance = step; distance < std::min(quarter_turn, 400.0); distance += step) {
            const double drift = across * distance * (typical + slope * distance),
                         x = x0 + distance * ux - drift * uy, y = y0 + distance * uy + drift * ux;
            const int i = static_cast<int>(std::floor(x / s_.pitch_x)),
                      j = static_cast<int>(std::floor(y / s_.pitch_y));
            const int kind = x / s_.pitch_x - i >= y / s_.pitch_y - j ? 0 : 1;
            if (i == column && j == row && kind == start.kind) continue;  // a flat facet does not see itself
            auto over = [&](double h) {  // of the ray, above what stands at height h
                const Vec3 q = displaced_position(s_.base, distance * ux, distance * uy, h);
                return h0 + slope * std::hypot(q.x, q.y) - q.z;
            };
            const double over_top = over(top_);
            if (kappa < 0 && !walk.hit) walk.clearance = std::min(walk.clearance, std::abs(over_top));
            if (over_top > 0) break;
            const double above = over(height(kind, i, j, x, y));
            lowest = std::min(lowest, above);
            if (above < 0 && !walk.hit) {
                walk.hit = true;
                walk.column = i, walk.row = j, walk.kind = kind;
            }
            if (lowest < -tolerance) break;
        }
        walk.clearance = std::min(walk.clearance, std::abs(lowest));
        return walk;
    }

  private:
    double height(int kind, int i, int j, double x, double y) const {
        const Gradient g = facet_gradient(s_, kind, i, j);
        return s_.at(i, j) + g.x * (x - i * s_.pitch_x) + g.y * (y - j * s_.pitch_y);
    }
    const HeightField& s_;
    double top_ = -1e300;
};

struct BaseCase {
    BaseCurvature base;
    double pitch_y;
};

class BentMarch : public ::testing::TestWithParam<BaseCase> {};

TEST_P(BentMarch, EqualsAWalkAlongTruePositions) {
    HeightField surface = generate_gaussian(40, 37, 1, 5, 0.8, 5);
    surface.pitch_y = GetParam().pitch_y;
    surface.base = GetParam().base;
    const MarchGrid grid = make_march_grid(surface);
    const ArcWalk walk(surface);
    // Facets are flat in space and not along the base: their edges sag by kappa pitch^2 / 8.
    const double kappa = std::max(std::abs(surface.base.kappa_1), std::abs(surface.base.kappa_2));
    const double sagitta = kappa * std::pow(std::max(1.0, surface.pitch_y), 2) / 4 + 0.01;
    int rays = 0, decided = 0, hits = 0, wrong = 0, other_facet = 0, n = 0;
    size_t most_layers = 0;
    for (const double elevation_deg : {-20.0, -4.0, 1.0, 5.0, 15.0, 35.0})
        for (const double phi_deg : {0.0, 25.0, 70.0, 90.0, 131.0, 180.0, 222.0, 301.0}) {
            const Vec3 d = to_vector({90 - elevation_deg, phi_deg});
            const FacetPoint start = facet_point(n % 2, fractional_part(0.37 * n), fractional_part(0.71 * n));
            ++n;
            const CellRect whole{0, 0, surface.nx, surface.ny};
            std::vector<uint32_t> visible(static_cast<size_t>(words_for(surface.nx)) * surface.ny);
            visible_along(grid, d, start, 3000, whole, visible.data());
            const std::vector<StartHeights> layers = start_heights(grid, d);
            most_layers = std::max(most_layers, layers.size());
            for (const StartHeights& layer : layers) {
                const RayBundle bundle = make_ray_bundle(grid, d, start, 3000, layer);
                const int width = bundle.transposed ? surface.ny : surface.nx,
                          lines = bundle.transposed ? surface.nx : surface.ny;
                HitLines found;
                march_hits(grid, bundle, 0, 0, width, lines, found);
                for (int k = n % 13; k < surface.nx * surface.ny; k += 13) {
                    const int i = k % surface.nx, j = k / surface.nx;
                    const double height = walk.start_height(i, j, start);
                    if (height < layer.from + 1e-4 || height > layer.below - 1e-4) continue;
                    const Walk expected = walk.trace(i, j, start, d, sagitta, layer.typical);
                    ++rays;
                    if (expected.clearance < sagitta) continue;
                    ++decided;
                    const int place = bundle.transposed ? j : i, line = bundle.transposed ? i : j;
                    const size_t word = static_cast<size_t>(line) * words_for(width) + place / 32;
                    const bool hit = found.hit[word] >> (place % 32) & 1;
                    const bool sees =
                        visible[static_cast<size_t>(j) * words_for(surface.nx) + i / 32] >> (i % 32) & 1;
                    wrong += hit != expected.hit || sees != (expected.front && !expected.hit);
                    if (!hit || !expected.hit) continue;
                    ++hits;
                    const CrossedFacet& facet = bundle.facets[found.crossing[word * 32 + place % 32]];
                    other_facet += i + (bundle.transposed ? facet.row : facet.column) != expected.column ||
                                   j + (bundle.transposed ? facet.column : facet.row) != expected.row;
                }
            }
        }
    EXPECT_EQ(wrong, 0);
    EXPECT_LT(other_facet, hits / 50) << "where the ray meets an edge";
    EXPECT_GT(hits, rays / 10);
    EXPECT_GT(decided, rays * 3 / 4);
    EXPECT_EQ(most_layers > 1, !surface.base.is_round());
}

INSTANTIATE_TEST_SUITE_P(Bases, BentMarch,
                         ::testing::Values(BaseCase{{0.02, 0.02, 0}, 1}, BaseCase{{0.03, 0, 0.4}, 1},
                                           BaseCase{{-0.01, -0.01, 0}, 1}, BaseCase{{0.02, -0.02, 0.3}, 0.6},
                                           BaseCase{{0, -0.02, 0}, 1.5}));

// Seen from its top, a base as round as that hides what a flat one shows, and a ray along it meets less.
TEST(BentMarch, ConvexBasesOpenTheReliefAndHollowsCloseIt) {
    HeightField surface = generate_gaussian(64, 64, 1, 6, 0.7, 9);
    auto lit = [&](double kappa) {
        surface.base = {kappa, kappa, 0};
        const MarchGrid grid = make_march_grid(surface);
        std::vector<uint32_t> visible(2 * 64);
        march_visible(grid, make_ray_bundle(grid, to_vector({75, 40}), facet_point(0, 0.6, 0.3), 3000),
                      {0, 0, 64, 64}, visible.data());
        int n = 0;
        for (const uint32_t word : visible) n += std::popcount(word);
        return n;
    };
    EXPECT_GT(lit(0.02), lit(0) + 100);
    EXPECT_LT(lit(-0.01), lit(0) - 100);
    EXPECT_EQ(lit(1e-12), lit(0));
}

TEST(BentMarch, NothingSteeperThanMaxSlopeHits) {
    for (const double kappa : {0.03, -0.02}) {
        HeightField surface = generate_gaussian(48, 48, 1, 5, 0.6, 2);
        surface.base = {kappa, kappa, 0};
        const MarchGrid grid = make_march_grid(surface);
        const double elevation_deg = degrees(std::atan(grid.max_slope)) + 0.01;
        for (int phi_deg = 0; phi_deg < 360; phi_deg += 15) {
            const RayBundle bundle = make_ray_bundle(grid, to_vector({90 - elevation_deg, 1.0 * phi_deg}),
                                                     facet_point(phi_deg / 15 % 2, 0.5, 0.2), 3000);
            HitLines found;
            march_hits(grid, bundle, 0, 0, 48, 48, found);
            for (const uint32_t word : found.hit) EXPECT_EQ(word, 0u);
        }
    }
}

}  // namespace
}  // namespace gonio
