// Height fields, generators, statistics, direction sets and material validation, against formulas.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <set>

#include "base/error.h"
#include "base/sha256.h"
#include "directions/gonio_grid.h"
#include "material/material.h"
#include "surface/facet_mesh.h"
#include "surface/generate.h"
#include "surface/statistics.h"

namespace gonio {
namespace {

Error error_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error;
    }
    ADD_FAILURE() << "no error was thrown";
    return {ErrorCode::internal, "", "", ""};
}

double height(const HeightField& s, int i, int j) {
    return s.mean_height + s.at(i, j);
}

bool any_contains(const std::vector<std::string>& sentences, const std::string& words) {
    for (const std::string& sentence : sentences)
        if (sentence.find(words) != std::string::npos) return true;
    return false;
}

// The same figures the slow way, facet by facet.
double rms_over_facets(const HeightField& s, const std::function<double(const Gradient&)>& square) {
    double sum = 0;
    for (int j = 0; j < s.ny; ++j)
        for (int i = 0; i < s.nx; ++i)
            for (int kind = 0; kind < 2; ++kind) sum += square(facet_gradient(s, kind, i, j));
    return std::sqrt(sum / (2.0 * s.nx * s.ny));
}

TEST(Sha256, KnownDigests) {
    EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_EQ(sha256_hex({"a", "bc"}), sha256_hex("abc"));
}

TEST(HeightField, SubtractsTheMeanInDouble) {
    // An offset of 1e6 pitches, at which a float keeps only 4 bits of the relief.
    std::vector<double> heights;
    for (int k = 0; k < 64; ++k) heights.push_back(1e6 + 0.25 * std::sin(k));
    const HeightField s = make_height_field(8, 8, 1, 1, heights);
    for (int k = 0; k < 64; ++k) EXPECT_NEAR(height(s, k % 8, k / 8), heights[k], 1e-7);
    EXPECT_NEAR(std::accumulate(s.heights.begin(), s.heights.end(), 0.0), 0, 1e-5);
}

TEST(HeightField, ConstantIsExactlyZero) {
    const HeightField s = make_height_field(5, 7, 1, 1, std::vector<double>(35, 123456.789));
    for (const float h : s.heights) EXPECT_EQ(h, 0.0f);
    EXPECT_EQ(s.mean_height, 123456.789);
}

TEST(HeightField, WrapsIndices) {
    const HeightField s = make_height_field(3, 2, 1, 1, {0, 1, 2, 3, 4, 5});
    EXPECT_EQ(s.at(-1, -1), s.at(2, 1));
    EXPECT_EQ(s.at(3, 2), s.at(0, 0));
}

TEST(HeightField, RefusesNonFiniteHeightsWithTheirPosition) {
    for (const double bad : {std::nan(""), double(INFINITY), -double(INFINITY)}) {
        std::vector<double> heights(12, 0.0);
        heights[2 * 4 + 3] = bad;
        const Error e = error_of([&] { make_height_field(4, 3, 1, 1, heights); });
        EXPECT_EQ(e.code(), ErrorCode::invalid_input);
        EXPECT_NE(std::string(e.what()).find("column 3, row 2"), std::string::npos) << e.what();
    }
}

TEST(HeightField, RefusesImpossibleSizesPitchesAndSteps) {
    EXPECT_EQ(error_of([] { make_height_field(2, 2, 1, 1, {0, 0, 0}); }).field(), "grid");
    EXPECT_EQ(error_of([] { make_height_field(0, 2, 1, 1, {}); }).field(), "grid");
    for (const double pitch : {0.0, -1.0, 1e-16, 2e7, std::nan(""), double(INFINITY)}) {
        EXPECT_EQ(error_of([=] { make_height_field(1, 1, pitch, 1, {0}); }).field(), "pitch_x");
        EXPECT_EQ(error_of([=] { make_height_field(1, 1, 1, pitch, {0}); }).field(), "pitch_y");
    }
    EXPECT_NO_THROW(make_height_field(2, 1, 1e-15, 1e7, {0, 0}));
    const Error e = error_of([] { make_height_field(3, 1, 1, 1, {0, 1e30, 0}); });
    EXPECT_NE(e.field().find("column 0, row 0"), std::string::npos) << e.what();
}

TEST(HeightField, HashNamesSizesPitchesAndHeights) {
    const HeightField s = make_height_field(2, 3, 1, 2, {0, 1, 2, 3, 4, 5});
    std::set<std::string> hashes{surface_hash(s)};
    EXPECT_EQ(surface_hash(s), surface_hash(make_height_field(2, 3, 1, 2, {0, 1, 2, 3, 4, 5})));
    hashes.insert(surface_hash(make_height_field(3, 2, 1, 2, {0, 1, 2, 3, 4, 5})));
    hashes.insert(surface_hash(make_height_field(2, 3, 2, 1, {0, 1, 2, 3, 4, 5})));
    hashes.insert(surface_hash(make_height_field(2, 3, 1, 2, {0, 1, 2, 3, 5, 4})));
    HeightField open = s;
    open.border_x = 1;
    hashes.insert(surface_hash(open));
    EXPECT_EQ(hashes.size(), 5u);
    EXPECT_EQ(surface_hash(s).size(), 64u);
}

TEST(Generate, PlaneIsFlat) {
    const HeightField s = generate_plane(4, 1e-3);
    EXPECT_EQ(s.heights, std::vector<float>(16, 0.0f));
    EXPECT_EQ(s.pitch_x, 1e-3);
}

TEST(Generate, VGrooveHasExactSlopesRidgeAndValley) {
    for (const double slope_deg : {1e-4, 20.0, 45.0, 70.0, 89.9}) {
        const HeightField s = generate_v_groove(128, 2e-3, slope_deg);
        ASSERT_EQ(s.ny, 1);
        const double t = std::tan(radians(slope_deg));
        EXPECT_NEAR(height(s, 64, 0) / (t * 1e-3), 1, 1e-6);
        EXPECT_NEAR(height(s, 0, 0) / (t * 1e-3), 0, 1e-6);
        for (int i = 0; i < 128; ++i)
            EXPECT_NEAR(facet_gradient(s, 0, i, 0).x / (i < 64 ? t : -t), 1, 1e-4)
                << slope_deg << " at " << i;
    }
    EXPECT_EQ(error_of([] { generate_v_groove(127, 1, 45); }).field(), "samples");
    EXPECT_EQ(error_of([] { generate_v_groove(128, 1, 90); }).field(), "slope_deg");
    EXPECT_EQ(error_of([] { generate_v_groove(128, 0, 45); }).field(), "period");
}

TEST(Generate, RectangularGrooveIsSampledAtCellCentres) {
    // Case rectgroove_a1_d0p5_b0p25: a = 1 of 1.25 is 8 of 10 samples.
    const HeightField s = generate_rectangular_groove(10, 1.25, 1, 0.5);
    for (int i = 0; i < 10; ++i) EXPECT_NEAR(height(s, i, 0), i < 8 ? -0.5 : 0.0, 1e-7);
    EXPECT_EQ(s.ny, 1);
    EXPECT_EQ(error_of([] { generate_rectangular_groove(10, 1, 1, 0.5); }).field(), "groove_width");
    EXPECT_EQ(error_of([] { generate_rectangular_groove(10, 1, 0.5, -1); }).field(), "depth");
}

TEST(Generate, SinusoidAndEggCrateFollowTheirFormulas) {
    const HeightField s = generate_sinusoid(64, 2.0, 0.3);
    for (int i = 0; i < 64; ++i) EXPECT_NEAR(height(s, i, 0), 0.3 * std::sin(2 * pi * i / 64), 1e-7);
    const HeightField e = generate_egg_crate(32, 2.0, 0.1);
    for (int j = 0; j < 32; ++j)
        for (int i = 0; i < 32; ++i)
            EXPECT_NEAR(height(e, i, j), 0.1 * (std::cos(2 * pi * i / 32) + std::cos(2 * pi * j / 32)), 1e-7);
}

TEST(Generate, SphericalPitsFollowTheirFormulaFromTheCellCentre) {
    const double period = 1.9816636488, eta = radians(60);  // case pits_eta60_cov0p6
    const HeightField s = generate_spherical_pits(200, period, 1, 60);
    int covered = 0;
    for (int j = 0; j < 200; ++j)
        for (int i = 0; i < 200; ++i) {
            const double u = (i + 0.5) / 200 * period - period / 2, v = (j + 0.5) / 200 * period - period / 2;
            const double r2 = u * u + v * v;
            const bool inside = r2 < std::pow(std::sin(eta), 2);
            covered += inside;
            ASSERT_NEAR(height(s, i, j), inside ? std::cos(eta) - std::sqrt(1 - r2) : 0.0, 1e-6);
        }
    EXPECT_NEAR(covered / 40000.0, 0.6, 0.002);
    EXPECT_EQ(error_of([] { generate_spherical_pits(8, 1, 1, 90); }).field(), "radius");
    EXPECT_EQ(error_of([] { generate_spherical_pits(8, 1, 1, 91); }).field(), "eta_deg");
}

TEST(Generate, GaussianHasExactlyTheStatedRmsSlope) {
    for (const double slope : {1e-6, 0.7, 1e3}) {
        const HeightField s = generate_gaussian(64, 32, 1e-6, 4e-6, slope, 5);
        const double rms = rms_over_facets(s, [](const Gradient& g) { return g.x * g.x + g.y * g.y; });
        EXPECT_NEAR(rms / slope, 1, 1e-5);
    }
}

TEST(Generate, GaussianIsAFunctionOfItsSeed) {
    const HeightField a = generate_gaussian(32, 32, 1, 4, 0.5, 1),
                      b = generate_gaussian(32, 32, 1, 4, 0.5, 1);
    EXPECT_EQ(a.heights, b.heights);
    EXPECT_NE(a.heights, generate_gaussian(32, 32, 1, 4, 0.5, 2).heights);
    const HeightField row = generate_gaussian(64, 1, 1, 4, 0.5, 1);
    EXPECT_EQ(row.ny, 1);
}

// Means over realisations against exp(-r^2 / l^2), at one cell (where a kernel sampled in space fails by 30
// %) and at eight. Rescaling fixes the slope, not the height, and the mean is subtracted: both are of order
// (l / n)^2 and far below the tolerance of 5 sigma.
TEST(Generate, GaussianHasTheStatedAutocorrelation) {
    for (const int l : {1, 2, 8}) {
        constexpr int n = 256, realisations = 24;
        std::vector<double> along_x, along_y, diagonal;
        double variance = 0;
        for (int seed = 1; seed <= realisations; ++seed) {
            const HeightField s = generate_gaussian(n, n, 1, l, 0.5, seed);
            double x = 0, y = 0, d = 0, v = 0;
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) {
                    const double h = s.at(i, j);
                    v += h * h;
                    x += h * s.at(i + l, j);
                    y += h * s.at(i, j + l);
                    d += h * s.at(i + l, j - l);
                }
            variance += v;
            along_x.push_back(x), along_y.push_back(y), diagonal.push_back(d);
        }
        const double sigma = std::sqrt(1.0 * l * l / (1.0 * n * n * realisations)) * 2;
        auto mean = [&](const std::vector<double>& c) {
            return std::accumulate(c.begin(), c.end(), 0.0) / variance;
        };
        EXPECT_NEAR(mean(along_x), std::exp(-1.0), 5 * sigma) << "l = " << l;
        EXPECT_NEAR(mean(along_y), std::exp(-1.0), 5 * sigma) << "l = " << l;
        EXPECT_NEAR(mean(diagonal), std::exp(-2.0), 5 * sigma) << "l = " << l;
    }
}

TEST(Generate, GaussianHeightsAreNormal) {
    const HeightField s = generate_gaussian(512, 512, 1, 2, 0.5, 3);
    double m2 = 0, m3 = 0, m4 = 0;
    for (const float h : s.heights) m2 += h * h, m3 += h * h * h, m4 += std::pow(h, 4);
    const double n = static_cast<double>(s.heights.size()), variance = m2 / n;
    // 512^2 / (pi l^2) = 21,000 independent points: the fourth moment varies by sqrt(96 / 21000) = 0.07, the
    // third by 0.03.
    EXPECT_NEAR(m4 / n / variance / variance, 3, 0.2);
    EXPECT_NEAR(m3 / n / std::pow(variance, 1.5), 0, 0.1);
}

TEST(Generate, GaussianRefusesWhatTheGridCannotHold) {
    EXPECT_EQ(error_of([] { generate_gaussian(64, 64, 1, 0.5, 0.5, 1); }).field(), "correlation_length");
    EXPECT_EQ(error_of([] { generate_gaussian(64, 64, 1, 17, 0.5, 1); }).field(), "correlation_length");
    EXPECT_EQ(error_of([] { generate_gaussian(64, 64, 1, 4, -1, 1); }).field(), "rms_slope");
    EXPECT_EQ(error_of([] { generate_gaussian(0, 64, 1, 4, 1, 1); }).field(), "samples");
}

TEST(Statistics, MatchTheSlowWayOnNonSquarePitch) {
    std::vector<double> heights;
    for (int k = 0; k < 30 * 20; ++k) heights.push_back(std::sin(0.7 * k) * std::cos(0.13 * k * k));
    const HeightField s = make_height_field(30, 20, 0.5, 3, heights);
    const SurfaceStatistics t = surface_statistics(s);
    EXPECT_NEAR(t.rms_slope_x, rms_over_facets(s, [](const Gradient& g) { return g.x * g.x; }), 1e-6);
    EXPECT_NEAR(t.rms_slope_y, rms_over_facets(s, [](const Gradient& g) { return g.y * g.y; }), 1e-6);
    double steepest = 0;
    for (int j = 0; j < 20; ++j)
        for (int i = 0; i < 30; ++i)
            for (int kind = 0; kind < 2; ++kind) {
                const Gradient g = facet_gradient(s, kind, i, j);
                steepest = std::max(steepest, std::hypot(g.x, g.y));
            }
    EXPECT_NEAR(t.max_slope, steepest, 1e-6);
    EXPECT_EQ(t.width, 15);
    EXPECT_EQ(t.depth, 60);
    EXPECT_NEAR(t.height_max, *std::max_element(heights.begin(), heights.end()), 1e-6);
    EXPECT_NEAR(t.height_min, *std::min_element(heights.begin(), heights.end()), 1e-6);
}

TEST(Statistics, TheSteepestFacetMayBeOfEitherKind) {
    // One cell, open so that no facet crosses the seam. One corner high: only the facet that has this corner
    // is steep.
    for (const std::vector<double>& corner : {std::vector<double>{0, 1, 0, 0}, {0, 0, 1, 0}}) {
        HeightField s = make_height_field(2, 2, 1, 1, corner);
        s.border_x = s.border_y = 1;
        EXPECT_NEAR(surface_statistics(s).max_slope, std::sqrt(2.0), 1e-6);
    }
}

TEST(Statistics, SinusoidInClosedForm) {
    const SurfaceStatistics t = surface_statistics(generate_sinusoid(1000, 1.0, 0.1));
    EXPECT_NEAR(t.sq, 0.1 / std::sqrt(2.0), 1e-6);
    EXPECT_NEAR(t.rms_slope_x, 0.1 * 2 * pi / std::sqrt(2.0), 1e-5);
    EXPECT_NEAR(t.correlation_length_x, std::acos(std::exp(-1.0)) / (2 * pi), 1e-5);  // cos(2 pi x) = 1/e
    EXPECT_EQ(t.rms_slope_y, 0);
    EXPECT_TRUE(t.invariant_y);
    EXPECT_FALSE(t.invariant_x);
    // The seam lies where the sine is steepest: its step^2 is twice the mean over all 1000 steps, of which
    // 999 are inside.
    EXPECT_NEAR(t.wrap_jump_x, std::sqrt(999.0 / 499.0), 1e-4);
    EXPECT_EQ(t.wrap_jump_y, 1);
}

TEST(Statistics, CorrelationLengthOfAGaussianSurface) {
    const SurfaceStatistics t = surface_statistics(generate_gaussian(512, 512, 1e-6, 8e-6, 0.3, 1));
    EXPECT_NEAR(t.correlation_length_x, 8e-6, 0.4e-6);
    EXPECT_NEAR(t.correlation_length_y, 8e-6, 0.4e-6);
    EXPECT_NEAR(t.wrap_jump_x, 1, 0.2);
    EXPECT_NEAR(t.wrap_jump_y, 1, 0.2);
}

TEST(Statistics, FlatAndTinySurfacesHaveFiniteFigures) {
    for (const auto& [nx, ny] : {std::pair(1, 1), std::pair(1, 5), std::pair(5, 1), std::pair(2, 2)}) {
        const SurfaceStatistics t =
            surface_statistics(make_height_field(nx, ny, 1, 1, std::vector<double>(nx * ny, 2.0)));
        EXPECT_EQ(t.sq, 0);
        EXPECT_EQ(t.max_slope, 0);
        EXPECT_EQ(t.wrap_jump_x, 1);
        EXPECT_EQ(t.wrap_jump_y, 1);
        EXPECT_EQ(t.correlation_length_x, 0);
        EXPECT_EQ(t.distinct_heights, 1);
        EXPECT_TRUE(t.invariant_x && t.invariant_y);
    }
}

TEST(Statistics, SeamOfARampIsAsHighAsItsSteps) {
    // A ramp of n points falls back by n - 1 steps.
    std::vector<double> heights;
    for (int k = 0; k < 10 * 4; ++k) heights.push_back(k % 10);
    const HeightField s = make_height_field(10, 4, 1, 1, heights);
    const SurfaceStatistics t = surface_statistics(s);
    EXPECT_NEAR(t.wrap_jump_x, 9, 1e-6);
    EXPECT_TRUE(any_contains(surface_warnings(s, t), "bad seam in x"));
    HeightField open = s;
    open.border_x = 2;
    const SurfaceStatistics inside = surface_statistics(open);
    EXPECT_NEAR(inside.rms_slope_x, 1, 1e-6);
    EXPECT_NEAR(inside.max_slope, 1, 1e-6);
    EXPECT_FALSE(any_contains(surface_warnings(open, inside), "seam"));
}

TEST(Statistics, GrooveWallAtTheSeamIsNoBadSeam) {
    const HeightField s = generate_rectangular_groove(100, 1, 0.5, 0.5);
    const SurfaceStatistics t = surface_statistics(s);
    EXPECT_GT(t.wrap_jump_x, 5);
    EXPECT_TRUE(surface_warnings(s, t).empty());
}

TEST(Statistics, DistinctHeightsAreCountedToTheirLimit) {
    std::vector<double> heights(300 * 300);
    for (size_t k = 0; k < heights.size(); ++k) heights[k] = static_cast<double>(k % 12345) * 1e-4;
    EXPECT_EQ(surface_statistics(make_height_field(300, 300, 1, 1, heights)).distinct_heights, 12345);
    for (size_t k = 0; k < heights.size(); ++k) heights[k] = static_cast<double>(k) / 65536;
    EXPECT_EQ(surface_statistics(make_height_field(300, 300, 1, 1, heights)).distinct_heights, 70000);
}

TEST(Warnings, TerracesOfEightBits) {
    HeightField s = generate_gaussian(128, 128, 1e-3, 16e-3, 0.3, 1);
    EXPECT_TRUE(surface_warnings(s, surface_statistics(s)).empty());
    const float step = 8 * static_cast<float>(surface_statistics(s).sq) / 255;
    for (float& h : s.heights) h = std::round(h / step) * step;
    const SurfaceStatistics t = surface_statistics(s);
    EXPECT_LE(t.distinct_heights, 256);
    EXPECT_TRUE(any_contains(surface_warnings(s, t), "8-bit"));
}

TEST(Warnings, PitchNearTheWavelengthOfLight) {
    const HeightField fine = generate_sinusoid(64, 64 * 0.5e-6, 1e-6),
                      coarse = generate_sinusoid(64, 64 * 5e-6, 1e-6);
    EXPECT_TRUE(any_contains(surface_warnings(fine, surface_statistics(fine)), "wavelength"));
    EXPECT_TRUE(surface_warnings(coarse, surface_statistics(coarse)).empty());
}

TEST(Directions, ProductGridHasThetaSlowest) {
    const auto grid = product_grid({0, 30}, {0, 90, 180});
    ASSERT_EQ(grid.size(), 6u);
    EXPECT_EQ(grid[2], (AnglesDeg{0, 180}));
    EXPECT_EQ(grid[3], (AnglesDeg{30, 0}));
}

TEST(Directions, HemisphereIntegratesCosineWeightedFunctions) {
    // Every direction stands for pi / n of projected solid angle: mean over directions = (1/pi) int f cos dw.
    const auto directions = equal_projected_hemisphere(256);
    double z = 0, x2 = 0, xy = 0;
    for (const AnglesDeg& a : directions) {
        EXPECT_LT(a.theta_deg, 90);
        const Vec3 v = to_vector(a);
        z += v.z / 256, x2 += v.x * v.x / 256, xy += v.x * v.y / 256;
    }
    EXPECT_NEAR(z, 2.0 / 3, 1e-4);
    // The azimuths of a Fibonacci lattice have a discrepancy of order 1 / n.
    EXPECT_NEAR(x2, 0.25, 1.0 / 256);
    EXPECT_NEAR(xy, 0, 1.0 / 256);
    EXPECT_EQ(error_of([] { equal_projected_hemisphere(0); }).field(), "hemisphere");
}

TEST(Directions, KlemsFullBasis) {
    const auto klems = klems_full();
    ASSERT_EQ(klems.size(), 145u);
    EXPECT_EQ(klems[0], (AnglesDeg{0, 0}));
    EXPECT_EQ(klems[1], (AnglesDeg{10, 0}));
    EXPECT_EQ(klems[2], (AnglesDeg{10, 45}));
    EXPECT_EQ(klems[1 + 8 + 16 + 1], (AnglesDeg{30, 18}));
    EXPECT_EQ(klems[144], (AnglesDeg{82.5, 330}));
}

TEST(Material, ValidationNamesTheField) {
    Lambertian scalar;
    scalar.albedo = {0.8};
    Material m{{"y"}, scalar};
    EXPECT_NO_THROW(validate(m, 4, 4));
    for (const double bad : {-0.1, 1.1, std::nan("")}) {
        scalar.albedo = {bad};
        m.lobes = {{1.0, scalar}};
        EXPECT_EQ(error_of([&] { validate(m, 4, 4); }).field(), "/material/albedo");
    }
    scalar.albedo = {0.8, 0.7, 0.6};
    m = {{"r", "g"}, scalar};
    EXPECT_EQ(error_of([&] { validate(m, 4, 4); }).field(), "/material/albedo");
    Parameter map;
    map.map_nx = 2, map.map_ny = 2;
    map.map.assign(8, 0.5f);
    m.lobes = {{1.0, Lambertian{map}}};
    EXPECT_NO_THROW(validate(m, 2, 2));
    EXPECT_EQ(error_of([&] { validate(m, 2, 3); }).field(), "/material/albedo");
    map.map[4 + 3] = 1.5f;
    m.lobes = {{1.0, Lambertian{map}}};
    EXPECT_NE(error_of([&] { validate(m, 2, 2); }).field().find("column 1, row 1"), std::string::npos);
    m.channels.clear();
    EXPECT_EQ(error_of([&] { validate(m, 2, 2); }).field(), "/material");
}

}  // namespace
}  // namespace gonio
