// The lockstep march against a scalar walk in double precision that shares nothing with it: cell by cell, two
// triangles a cell, Moller and Trumbore's intersection.
#include "visibility/march.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "base/bits.h"
#include "directions/direction_set.h"
#include "surface/generate.h"

namespace gonio {
namespace {

constexpr double grazing = 1e-4;  // cells: rays that pass an edge nearer than this may go either way

Vec3 minus(const Vec3& a, const Vec3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct ScalarHit {
    bool front = false, hit = false;
    int column = 0, row = 0, kind = 0;  // of the hit facet's cell, unwrapped
    double travel = 0;                  // cells
    double clearance = 1e300;           // smallest |ray - relief| over the edges that it passes, cells
    double horizon = 0;                 // largest rise per cell of travel over the edges, at least 0
    double horizon_travel = 0;          // cells to the edge where it is
};

// Works in cells along x and y and pitch_x along z.
class ScalarMarch {
  public:
    explicit ScalarMarch(const HeightField& surface) : surface_(surface) {
        lowest_ = highest_ = height(0, 0);
        for (int j = 0; j < surface.ny; ++j)
            for (int i = 0; i < surface.nx; ++i) {
                lowest_ = std::min(lowest_, height(i, j));
                highest_ = std::max(highest_, height(i, j));
            }
    }

    // only_horizon: walk to the end and note the horizon instead of looking for a hit.
    ScalarHit trace(int column, int row, const FacetPoint& start, const Vec3& direction, double max_travel,
                    bool only_horizon = false) const {
        Vec3 d{direction.x / surface_.pitch_x, direction.y / surface_.pitch_y,
               direction.z / surface_.pitch_x};
        const double horizontal = std::hypot(d.x, d.y);
        d = {d.x / horizontal, d.y / horizontal, d.z / horizontal};
        const Vec3 origin{column + start.u, row + start.v,
                          relief(start.kind, column, row, column + start.u, row + start.v)};
        ScalarHit result;
        const double facing = d.z - slope_along(start.kind, column, row, d);
        result.front = facing > 0;
        result.clearance = std::abs(facing);
        if (!result.front && !only_horizon) return result;

        double travel = 0;
        int cell_x = column, cell_y = row;
        for (bool first = true; travel < max_travel; first = false) {
            // To the next grid line; the diagonal in between splits the cell into two pieces.
            const double to_x = next_line(origin.x, d.x, cell_x), to_y = next_line(origin.y, d.y, cell_y);
            const double end = std::min(to_x, to_y);
            double diagonal = end;
            if (std::abs(d.x - d.y) > 1e-12) {
                const double t = -((origin.x - cell_x) - (origin.y - cell_y)) / (d.x - d.y);
                if (t > travel && t < end) diagonal = t;
            }
            for (const auto& [from, to] : {std::pair{travel, diagonal}, std::pair{diagonal, end}}) {
                if (!(to > from) || to > max_travel) continue;
                const double middle = (from + to) / 2;
                const int kind = origin.x + d.x * middle - cell_x >= origin.y + d.y * middle - cell_y ? 0 : 1;
                const double x = origin.x + d.x * to, y = origin.y + d.y * to;
                const double edge = relief(kind, cell_x, cell_y, x, y);
                if ((edge - origin.z) / to > result.horizon) {
                    result.horizon = (edge - origin.z) / to;
                    result.horizon_travel = to;
                }
                const bool own = first && kind == start.kind;
                if (!own) result.clearance = std::min(result.clearance, std::abs(origin.z + d.z * to - edge));
                if (own || only_horizon) continue;
                const double t = intersection(origin, d, kind, cell_x, cell_y);
                if (t > 0) {
                    result.hit = true;
                    result.column = cell_x, result.row = cell_y, result.kind = kind;
                    result.travel = t;
                    return result;
                }
            }
            travel = end;
            if (to_x <= end) cell_x += d.x > 0 ? 1 : -1;
            if (to_y <= end) cell_y += d.y > 0 ? 1 : -1;
            const double z = origin.z + d.z * travel;
            if (!only_horizon && ((d.z > 0 && z > highest_) || (d.z < 0 && z < lowest_ - 1))) break;
        }
        return result;
    }

  private:
    double height(int i, int j) const { return surface_.at(i, j) / surface_.pitch_x; }
    Vec3 node(int i, int j) const { return {static_cast<double>(i), static_cast<double>(j), height(i, j)}; }
    static double next_line(double from, double rate, int cell) {
        if (std::abs(rate) < 1e-12) return 1e300;
        return (cell + (rate > 0 ? 1 : 0) - from) / rate;
    }
    double slope_along(int kind, int i, int j, const Vec3& d) const {
        return relief(kind, i, j, i + d.x, j + d.y) - relief(kind, i, j, i, j);
    }
    // The plane of a facet.
    double relief(int kind, int i, int j, double x, double y) const {
        const double u = x - i, v = y - j, h00 = height(i, j), h11 = height(i + 1, j + 1);
        if (kind == 0) return h00 + u * (height(i + 1, j) - h00) + v * (h11 - height(i + 1, j));
        return h00 + v * (height(i, j + 1) - h00) + u * (h11 - height(i, j + 1));
    }
    // Distance to a facet, or -1. Edges belong to both facets, so that no ray slips through.
    double intersection(const Vec3& origin, const Vec3& d, int kind, int i, int j) const {
        const Vec3 a = node(i, j), b = kind == 0 ? node(i + 1, j) : node(i, j + 1), c = node(i + 1, j + 1);
        const Vec3 ab = minus(b, a), ac = minus(c, a), p = cross(d, ac);
        const double determinant = dot(ab, p);
        if (determinant == 0) return -1;
        const Vec3 from = minus(origin, a), q = cross(from, ab);
        const double u = dot(from, p) / determinant, v = dot(d, q) / determinant;
        constexpr double shared_edge = 1e-9;
        if (u < -shared_edge || v < -shared_edge || u + v > 1 + shared_edge) return -1;
        const double t = dot(ac, q) / determinant;
        return t > 1e-9 ? t : -1;
    }
    const HeightField& surface_;
    double lowest_, highest_;
};

HeightField white_noise(int nx, int ny, double amplitude, double pitch_y, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, amplitude);
    std::vector<double> heights(static_cast<size_t>(nx) * ny);
    for (double& h : heights) h = uniform(random);
    return make_height_field(nx, ny, 1, pitch_y, heights);
}

Vec3 direction(double elevation_deg, double phi_deg) {
    return to_vector({90 - elevation_deg, phi_deg});
}

bool bit(const std::vector<uint32_t>& bits, int width, int column, int row) {
    return bits[static_cast<size_t>(row) * words_for(width) + column / 32] >> (column % 32) & 1;
}

struct Tally {
    long long rays = 0, grazes = 0, hits = 0, visible = 0;
    // Grazing is rare: one ray in a thousand.
    void check() const {
        EXPECT_LE(grazes, 2 + rays / 1000);
        EXPECT_GT(visible, 0);
    }
};

constexpr double max_travel = 3000;

// march_visible and march_hits of one bundle against the scalar walk; every `stride`th cell of the rectangle.
void compare(const HeightField& surface, const MarchGrid& grid, const FacetPoint& start, const Vec3& d,
             const CellRect& rect, int stride, Tally& tally) {
    const ScalarMarch scalar(surface);
    const RayBundle bundle = make_ray_bundle(grid, d, start, max_travel);
    std::vector<uint32_t> visible(static_cast<size_t>(words_for(rect.width)) * rect.height, 0xdeadbeef);
    march_visible(grid, bundle, rect, visible.data());
    const bool turned = bundle.transposed;
    HitLines lines;
    march_hits(grid, bundle, turned ? rect.y0 : rect.x0, turned ? rect.x0 : rect.y0,
               turned ? rect.height : rect.width, turned ? rect.width : rect.height, lines);
    for (int row = 0; row < rect.height; ++row)
        for (int c = rect.width; c < 32 * words_for(rect.width); ++c)
            EXPECT_FALSE(bit(visible, rect.width, c, row));

    for (int k = 0; k < rect.width * rect.height; k += stride) {
        const int c = k % rect.width, r = k / rect.width;
        const int line = turned ? c : r, place = turned ? r : c, width = turned ? rect.height : rect.width;
        const ScalarHit expected = scalar.trace(rect.x0 + c, rect.y0 + r, start, d, max_travel);
        const bool sees = bit(visible, rect.width, c, r), hit = bit(lines.hit, width, place, line),
                   front = bit(lines.front, width, place, line);
        EXPECT_EQ(sees, front && !hit);
        bool same = front == expected.front && hit == expected.hit;
        if (same && hit) {
            const int at = lines.crossing[static_cast<size_t>(line) * words_for(width) * 32 + place];
            const CrossedFacet& facet = bundle.facets[at];
            same = (turned ? facet.row : facet.column) + rect.x0 + c == expected.column &&
                   (turned ? facet.column : facet.row) + rect.y0 + r == expected.row &&
                   (turned ? 1 - facet.kind : facet.kind) == expected.kind &&
                   expected.travel < facet.travel + grazing &&
                   expected.travel > bundle.facets[at - 1].travel - grazing;
        }
        ++tally.rays;
        tally.hits += hit;
        tally.visible += sees;
        if (same) continue;
        ++tally.grazes;
        EXPECT_LT(expected.clearance, grazing)
            << "cell " << rect.x0 + c << ", " << rect.y0 + r << " kind " << start.kind << " at " << start.u
            << ", " << start.v << " towards " << d.x << ", " << d.y << ", " << d.z << ": front " << front
            << " hit " << hit << ", scalar front " << expected.front << " hit " << expected.hit << " in "
            << expected.column << ", " << expected.row << " after " << expected.travel;
    }
}

std::vector<FacetPoint> several_points() {
    return {facet_point(0, 2.0 / 3, 1.0 / 3), facet_point(1, 2.0 / 3, 1.0 / 3), facet_point(0, 0.02, 0.95),
            facet_point(1, 0.61, 0.6), facet_point(1, 0.3, 0.9, 2, 3)};
}

void compare_all_ways(const HeightField& surface, const std::vector<double>& elevations_deg, int stride,
                      Tally& tally) {
    const MarchGrid grid = make_march_grid(surface);
    const CellRect whole{0, 0, surface.nx, surface.ny};
    const std::vector<FacetPoint> points = several_points();
    int n = 0;
    for (const double elevation_deg : elevations_deg)
        for (const double phi_deg : {0.0, 17.0, 45.0, 60.0, 90.0, 118.0, 135.0, 163.0, 180.0, 199.0, 225.0,
                                     250.0, 270.0, 289.0, 315.0, 344.0})
            compare(surface, grid, points[n++ % points.size()], direction(elevation_deg, phi_deg), whole,
                    stride, tally);
}

TEST(March, EqualsScalarWalkOnWhiteNoise) {
    Tally tally;
    for (const double amplitude : {0.3, 2.5, 40.0})
        compare_all_ways(white_noise(33, 40, amplitude, 1, 7), {5, 20, 50, 75, 89.9, -5, -40, -89}, 1, tally);
    EXPECT_GT(tally.hits, tally.rays / 10);
    tally.check();
}

TEST(March, EqualsScalarWalkOnGaussianFieldsOfAnyPitch) {
    Tally tally;
    for (const double pitch_y : {1.0, 0.2, 7.0}) {
        HeightField surface = generate_gaussian(48, 64, 1, 4, 1.2, 3);
        surface.pitch_y = pitch_y;
        compare_all_ways(surface, {2, 5, 12, 30, 60, -3, -25}, 3, tally);
    }
    EXPECT_GT(tally.hits, tally.rays / 10);
    tally.check();
}

TEST(March, EqualsScalarWalkOnTinyGrids) {
    for (const auto& [nx, ny] : std::vector<std::pair<int, int>>{
             {1, 1}, {1, 2}, {2, 1}, {1, 7}, {7, 1}, {1, 40}, {40, 1}, {2, 2}, {5, 3}, {3, 33}, {33, 3}}) {
        Tally tally;
        for (const double pitch_y : {1.0, 3.0})
            compare_all_ways(white_noise(nx, ny, 1.5, pitch_y, 5), {5, 15, 40, 70, 89.9, -10, -60}, 1, tally);
        tally.check();
    }
}

TEST(March, WrapsTileRectangles) {
    const HeightField surface = white_noise(70, 45, 3, 1, 11);
    const MarchGrid grid = make_march_grid(surface);
    Tally tally;
    int n = 0;
    const std::vector<FacetPoint> points = several_points();
    for (const CellRect& rect : {CellRect{60, 40, 25, 13}, CellRect{69, 44, 70, 45}, CellRect{3, 5, 33, 31},
                                 CellRect{37, 20, 64, 33}, CellRect{0, 13, 1, 45}})
        for (const double phi_deg : {10.0, 100.0, 215.0, 275.0})
            for (const double elevation_deg : {8.0, 35.0, -20.0})
                compare(surface, grid, points[n++ % points.size()], direction(elevation_deg, phi_deg), rect,
                        1, tally);
    tally.check();
}

// At 5 degrees over a rough field rays pass hundreds of edges, most of them under window maxima.
TEST(March, WindowMaximaSkipNothingThatCounts) {
    const HeightField surface = generate_gaussian(200, 180, 1, 6, 0.9, 21);
    const MarchGrid grid = make_march_grid(surface);
    const CellRect whole{0, 0, surface.nx, surface.ny};
    Tally tally;
    int n = 0;
    size_t windows = 0;
    for (const double elevation_deg : {1.5, 5.0, 11.0, -4.0})
        for (const double phi_deg : {3.0, 47.0, 95.0, 171.0, 230.0, 281.0, 340.0}) {
            const FacetPoint point = several_points()[n++ % 5];
            const Vec3 d = direction(elevation_deg, phi_deg);
            compare(surface, grid, point, d, whole, 67, tally);
            const RayBundle bundle = make_ray_bundle(grid, d, point, max_travel);
            RayBundle singly = bundle;
            singly.groups = {{static_cast<int>(bundle.crossings.size()), -1, 0, 0, 0}};
            windows += bundle.groups.size() - 1;
            std::vector<uint32_t> with(static_cast<size_t>(words_for(whole.width)) * whole.height),
                without(with.size());
            march_visible(grid, bundle, whole, with.data());
            march_visible(grid, singly, whole, without.data());
            EXPECT_EQ(with, without);
            HitLines hits_with, hits_without;
            const int width = bundle.transposed ? whole.height : whole.width,
                      lines = bundle.transposed ? whole.width : whole.height;
            march_hits(grid, bundle, 0, 0, width, lines, hits_with);
            march_hits(grid, singly, 0, 0, width, lines, hits_without);
            EXPECT_EQ(hits_with.hit, hits_without.hit);
            for (size_t k = 0; k < hits_with.crossing.size(); ++k)
                if (hits_with.hit[k / 32] >> (k % 32) & 1) {
                    ASSERT_EQ(hits_with.crossing[k], hits_without.crossing[k]);
                }
        }
    EXPECT_GT(windows, 100u);
    tally.check();
}

class SimdTarget : public ::testing::Test {
  protected:
    void TearDown() override { force_simd_target(""); }
};

TEST_F(SimdTarget, AllAgreeWithTheScalarWalkAndEachOther) {
    const HeightField surface = white_noise(65, 40, 2, 1, 17);
    const MarchGrid grid = make_march_grid(surface);
    const CellRect whole{0, 0, surface.nx, surface.ny};
    EXPECT_FALSE(force_simd_target("no such target"));
    std::vector<std::vector<uint32_t>> bits;
    std::vector<std::vector<float>> horizons;
    for (const char* target : {"SSE4", "AVX2", "AVX3"}) {
        if (!force_simd_target(target)) {
            EXPECT_STRNE(target, "SSE4") << "every machine that gonio runs on has it";
            continue;
        }
        Tally tally;
        compare_all_ways(surface, {6, 30, -15}, 5, tally);
        tally.check();
        bits.emplace_back();
        horizons.emplace_back();
        for (const double phi_deg : {20.0, 110.0, 250.0}) {
            const RayBundle bundle =
                make_ray_bundle(grid, direction(20, phi_deg), facet_point(0, 0.7, 0.2), 100);
            std::vector<uint32_t> visible(static_cast<size_t>(words_for(whole.width)) * whole.height);
            march_visible(grid, bundle, whole, visible.data());
            bits.back().insert(bits.back().end(), visible.begin(), visible.end());
            std::vector<float> slope(static_cast<size_t>(whole.width) * whole.height);
            march_horizon(grid, bundle, whole, slope.data());
            horizons.back().insert(horizons.back().end(), slope.begin(), slope.end());
        }
    }
    for (size_t t = 1; t < bits.size(); ++t) {
        int differences = 0;
        for (size_t k = 0; k < bits[0].size(); ++k)
            differences += __builtin_popcount(bits[0][k] ^ bits[t][k]);
        EXPECT_LE(differences, 2);
        for (size_t k = 0; k < horizons[0].size(); ++k)
            EXPECT_NEAR(horizons[0][k], horizons[t][k], 1e-5 * (1 + horizons[0][k]));
    }
}

TEST(March, HorizonEqualsScalarWalk) {
    constexpr double far = 150;
    for (const auto& [nx, ny, pitch_y] : std::vector<std::tuple<int, int, double>>{
             {40, 37, 1}, {64, 48, 2.5}, {1, 9, 1}, {9, 1, 1}, {5, 3, 0.3}}) {
        const HeightField surface = white_noise(nx, ny, 2, pitch_y, 31);
        const MarchGrid grid = make_march_grid(surface);
        const ScalarMarch scalar(surface);
        const CellRect rect{nx / 2, ny / 3, nx, ny};
        for (const double phi_deg : {0.0, 33.0, 80.0, 90.0, 145.0, 200.0, 262.0, 310.0})
            for (const FacetPoint& start : several_points()) {
                const Vec3 d = direction(0, phi_deg);
                const RayBundle bundle = make_ray_bundle(grid, d, start, far);
                std::vector<float> slope(static_cast<size_t>(rect.width) * rect.height), distance(slope);
                march_horizon(grid, bundle, rect, slope.data(), distance.data());
                // A cell of travel along d, in pitch_x.
                const double cell = 1 / std::hypot(d.x, d.y / pitch_y);
                for (int r = 0; r < rect.height; ++r)
                    for (int c = 0; c < rect.width; ++c) {
                        const ScalarHit expected =
                            scalar.trace(rect.x0 + c, rect.y0 + r, start, d, far, true);
                        const size_t at = static_cast<size_t>(r) * rect.width + c;
                        ASSERT_NEAR(slope[at], expected.horizon / cell, 1e-5 * (1 + expected.horizon / cell));
                        // Where a row is all there is, both facets of a cell are one plane: edges tie.
                        if (nx > 1 && ny > 1) {
                            ASSERT_NEAR(distance[at], expected.horizon_travel * cell,
                                        1e-4 * (1 + expected.horizon_travel * cell));
                        }
                    }
            }
    }
}

// A ray just below the horizon hits, one just above it does not.
TEST(March, HorizonParsVisibleFromHidden) {
    const HeightField surface = generate_gaussian(64, 64, 1, 5, 0.8, 4);
    const MarchGrid grid = make_march_grid(surface);
    const CellRect whole{0, 0, 64, 64};
    const FacetPoint start = facet_point(1, 0.3, 0.8);
    std::vector<float> slope(64 * 64);
    for (const double phi_deg : {25.0, 140.0, 265.0}) {
        march_horizon(grid, make_ray_bundle(grid, direction(0, phi_deg), start, 1000), whole, slope.data());
        for (const double elevation_deg : {3.0, 10.0, 25.0}) {
            const RayBundle bundle = make_ray_bundle(grid, direction(elevation_deg, phi_deg), start, 1000);
            std::vector<uint32_t> visible(2 * 64);
            march_visible(grid, bundle, whole, visible.data());
            const double tangent = std::tan(radians(elevation_deg));
            for (int k = 0; k < 64 * 64; ++k)
                if (std::abs(slope[k] - tangent) > 1e-4) {
                    ASSERT_EQ(bit(visible, 64, k % 64, k / 64), slope[k] < tangent);
                }
        }
    }
}

TEST(FacetPoint, PartIsItsInverse) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (const int refinement : {1, 2, 4, 8})
        for (int kind = 0; kind < 2; ++kind) {
            double mean_u = 0, mean_v = 0;
            std::vector<int> inside(refinement * refinement, 0);
            constexpr int n = 400;
            for (int part = 0; part < refinement * refinement; ++part)
                for (int k = 0; k < n; ++k) {
                    const FacetPoint p =
                        facet_point(kind, uniform(random), uniform(random), refinement, part);
                    EXPECT_EQ(p.kind, kind);
                    EXPECT_EQ(facet_part(kind, p.u, p.v, refinement), part);
                    EXPECT_TRUE(kind == 0 ? p.u > p.v : p.v > p.u);
                    EXPECT_GT(std::min(p.u, p.v), 0);
                    EXPECT_LT(std::max(p.u, p.v), 1);
                    mean_u += p.u, mean_v += p.v;
                    // Any point of the facet, to count how much of it belongs to each part.
                    const FacetPoint any = facet_point(kind, uniform(random), uniform(random));
                    ++inside[facet_part(kind, any.u, any.v, refinement)];
                }
            const double total = n * refinement * refinement;
            EXPECT_NEAR(mean_u / total, kind == 0 ? 2.0 / 3 : 1.0 / 3, 4 * 0.236 / std::sqrt(total));
            EXPECT_NEAR(mean_v / total, kind == 0 ? 1.0 / 3 : 2.0 / 3, 4 * 0.236 / std::sqrt(total));
            for (const int count : inside) EXPECT_NEAR(count, n, 5 * std::sqrt(n));
        }
}

TEST(Bits, TransposeSwapsRowsAndColumns) {
    std::mt19937 random(2);
    uint32_t matrix[32], turned[32];
    for (int r = 0; r < 32; ++r) matrix[r] = turned[r] = static_cast<uint32_t>(random());
    transpose_bits(turned);
    for (int r = 0; r < 32; ++r)
        for (int c = 0; c < 32; ++c) EXPECT_EQ(turned[c] >> r & 1, matrix[r] >> c & 1);
}

// rms over random shifts of the relative error of the integral of f(direction, z / z_max) over the slab.
template <class Function>
double slab_error(int n, double z_max, double exact, Function&& f) {
    double sum = 0;
    constexpr int shifts = 16;
    for (int s = 0; s < shifts; ++s) {
        const DirectionSet set = slab_directions(n, z_max, (s + 0.3) / shifts, fractional_part(s * 0.7548));
        double weights = 0, integral = 0;
        for (int k = 0; k < n; ++k) {
            const Vec3& d = set.directions[k];
            EXPECT_NEAR(dot(d, d), 1, 1e-12);
            EXPECT_LE(std::abs(d.z), z_max);
            EXPECT_GE(std::abs(d.z), 1e-4);
            weights += set.solid_angle[k];
            integral += set.solid_angle[k] * f(d, d.z / z_max);
        }
        EXPECT_NEAR(weights, 4 * pi * z_max, 1e-12 * weights);
        sum += std::pow(integral / exact - 1, 2) / shifts;
    }
    return std::sqrt(sum);
}

TEST(SlabDirections, WeightsAndQuadrature) {
    for (const double z_max : {0.05, 0.6, 1.0}) {
        // As the transport sees it: smooth, and nothing beyond the steepest slope. Falls as n^-2.
        const auto vanishing = [](const Vec3& d, double t) {
            return (1 - t * t) * (1 - t * t) * (1 + d.y + d.x * d.x + d.x * d.y * t);
        };
        // Over a ring x and x y vanish and x^2 is pi (1 - z^2).
        const double exact = pi * z_max * (3 * 16.0 / 15 - z_max * z_max * 16.0 / 105);
        EXPECT_LT(slab_error(64, z_max, exact, vanishing), 1e-3);
        EXPECT_LT(slab_error(1024, z_max, exact, vanishing), 3e-6);
        // Any smooth function: as n^-1, for the ends of the slab do not meet.
        const auto smooth = [](const Vec3& d, double t) { return std::exp(2 * t) + d.x * d.x + d.x * d.y; };
        const double exact_smooth =
            2 * pi * z_max * std::sinh(2) + 2 * pi * (z_max - z_max * z_max * z_max / 3);
        EXPECT_LT(64 * slab_error(64, z_max, exact_smooth, smooth), 2);
        EXPECT_LT(4096 * slab_error(4096, z_max, exact_smooth, smooth), 2);
    }
}

}  // namespace
}  // namespace gonio
