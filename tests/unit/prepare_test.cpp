// From stored numbers to the relief: each step alone, then the real samples.
#include "surface/prepare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.h"
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

// A raw grid with h(i, j), carrying a square pitch of 1 m and heights in metres.
RawHeights raw_grid(int nx, int ny, const std::function<double(int, int)>& h) {
    RawHeights raw;
    raw.nx = nx, raw.ny = ny;
    raw.format = "test";
    raw.pitch_x = raw.pitch_y = 1.0;
    raw.height_unit = 1.0;
    for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i) raw.values.push_back(h(i, j));
    return raw;
}

double numbered(int i, int j) {
    return i + 10 * j;
}

double height(const PreparedSurface& p, int i, int j) {
    return p.surface.mean_height + p.surface.at(i, j);
}

bool notes_contain(const PreparedSurface& p, const std::string& words) {
    for (const std::string& note : p.notes)
        if (note.find(words) != std::string::npos) return true;
    return false;
}

TEST(Units, NothingCarriedAndNothingStatedIsAnErrorThatNamesTheField) {
    RawHeights raw = raw_grid(4, 2, numbered);
    raw.pitch_x.reset(), raw.pitch_y.reset();
    Error e = error_of([&] { prepare_surface(raw, {}); });
    EXPECT_EQ(e.code(), ErrorCode::missing_unit);
    EXPECT_EQ(e.field(), "/surface/width");
    EXPECT_NE(std::string(e.what()).find("test"), std::string::npos);

    raw = raw_grid(4, 2, numbered);
    raw.height_unit.reset();
    e = error_of([&] { prepare_surface(raw, {}); });
    EXPECT_EQ(e.code(), ErrorCode::missing_unit);
    EXPECT_EQ(e.field(), "/surface/height_scale");

    raw = raw_grid(4, 2, numbered);
    raw.pitch_y.reset();
    EXPECT_EQ(error_of([&] { prepare_surface(raw, {}); }).field(), "/surface/depth");
}

TEST(Units, StatedLengthsGiveThePitch) {
    RawHeights raw = raw_grid(4, 2, numbered);
    raw.pitch_x.reset(), raw.pitch_y.reset();
    PrepareOptions options;
    options.width = 8;
    PreparedSurface p = prepare_surface(raw, options);
    EXPECT_EQ(p.surface.pitch_x, 2);
    EXPECT_EQ(p.surface.pitch_y, 2);
    options.depth = 1;
    EXPECT_EQ(prepare_surface(raw, options).surface.pitch_y, 0.5);
    options = {};
    options.depth = 1;
    EXPECT_EQ(prepare_surface(raw, options).surface.pitch_x, 0.5);
    options = {};
    options.pitch_x = 3, options.pitch_y = 4;
    p = prepare_surface(raw, options);
    EXPECT_EQ(p.surface.pitch_x, 3);
    EXPECT_EQ(p.surface.pitch_y, 4);
}

TEST(Units, AStatedWidthKeepsTheFilesAspectAndTheDeviationIsNoted) {
    RawHeights raw = raw_grid(4, 2, numbered);
    raw.pitch_y = 2.5;
    PrepareOptions options;
    options.width = 8;
    const PreparedSurface p = prepare_surface(raw, options);
    EXPECT_EQ(p.surface.pitch_x, 2);
    EXPECT_EQ(p.surface.pitch_y, 5);
    EXPECT_TRUE(notes_contain(p, "the file says 1 m"));
}

TEST(Units, ContradictionsAndNonsenseAreRefused) {
    const RawHeights raw = raw_grid(4, 2, numbered);
    PrepareOptions options;
    options.width = 8, options.pitch_x = 2;
    EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/pitch_x");
    options = {};
    options.height_scale = 1, options.height_range = 1;
    EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/height_range");
    for (const double bad : {0.0, -1.0, std::nan(""), double(INFINITY)}) {
        options = {};
        options.width = bad;
        EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/width");
        options = {};
        options.pitch_y = bad;
        EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/pitch_y");
        options = {};
        options.height_scale = bad;
        EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/height_scale");
    }
    options = {};
    options.width = 1e30;
    EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/pitch_x");
}

TEST(Units, HeightRangeOfIntegersIsTheirMaximumAndOfFloatsTheirSpan) {
    RawHeights raw = raw_grid(2, 1, [](int i, int) { return i == 0 ? 51.0 : 102.0; });
    raw.height_unit.reset();
    PrepareOptions options;
    options.height_range = 5;
    raw.bits = 8, raw.integer_max = 255;
    PreparedSurface p = prepare_surface(raw, options);
    EXPECT_NEAR(height(p, 1, 0) - height(p, 0, 0), 1, 1e-6);
    EXPECT_EQ(p.stored_bits, 8);
    EXPECT_TRUE(notes_contain(p, "8 bits"));
    raw.bits = 0, raw.integer_max = 0;
    p = prepare_surface(raw, options);
    EXPECT_NEAR(height(p, 1, 0) - height(p, 0, 0), 5, 1e-6);
}

TEST(Units, ScaleOffsetAndInvert) {
    PrepareOptions options;
    options.height_scale = 0.5, options.height_offset = 100, options.invert = true;
    const PreparedSurface p = prepare_surface(raw_grid(4, 3, numbered), options);
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 4; ++i) EXPECT_NEAR(height(p, i, j), 100 - 0.5 * numbered(i, j), 1e-5);
}

TEST(Orientation, FollowsTheFormatUnlessOverridden) {
    RawHeights raw = raw_grid(4, 3, numbered);
    EXPECT_NEAR(height(prepare_surface(raw, {}), 1, 0), numbered(1, 0), 1e-5);
    raw.row0_at_top = true;
    EXPECT_NEAR(height(prepare_surface(raw, {}), 1, 0), numbered(1, 2), 1e-5);
    PrepareOptions options;
    options.y_up = true;
    EXPECT_NEAR(height(prepare_surface(raw, options), 1, 0), numbered(1, 0), 1e-5);
    raw.row0_at_top = false;
    options.y_up = false;
    EXPECT_NEAR(height(prepare_surface(raw, options), 1, 0), numbered(1, 2), 1e-5);
}

TEST(Crop, IsInStoredOrientationAndKeepsThePitchOfTheWhole) {
    RawHeights raw = raw_grid(8, 6, numbered);
    raw.row0_at_top = true;
    raw.pitch_x.reset(), raw.pitch_y.reset();
    PrepareOptions options;
    options.width = 8;
    options.crop = {2, 1, 4, 3};
    const PreparedSurface p = prepare_surface(raw, options);
    ASSERT_EQ(p.surface.nx, 4);
    ASSERT_EQ(p.surface.ny, 3);
    EXPECT_EQ(p.surface.pitch_x, 1);
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 4; ++i) EXPECT_NEAR(height(p, i, j), numbered(2 + i, 1 + 2 - j), 1e-5);
}

TEST(Crop, OutsideTheGridIsRefused) {
    const RawHeights raw = raw_grid(8, 6, numbered);
    constexpr int huge = std::numeric_limits<int>::max();
    for (const std::array<int, 4>& crop : {std::array{-1, 0, 2, 2},
                                           {0, 0, 9, 1},
                                           {7, 0, 2, 1},
                                           {0, 0, 0, 1},
                                           {huge, huge, huge, huge},
                                           {1, 1, huge, 1}}) {
        PrepareOptions options;
        options.crop = crop;
        EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface/crop");
    }
}

TEST(Missing, IsRejectedWithItsPositionInTheFile) {
    RawHeights raw = raw_grid(8, 6, numbered);
    raw.values[4 * 8 + 5] = std::nan("");
    raw.row0_at_top = true;
    const Error e = error_of([&] { prepare_surface(raw, {}); });
    EXPECT_NE(e.field().find("column 5, row 4"), std::string::npos) << e.what();
    PrepareOptions options;
    options.crop = {1, 1, 6, 4};
    EXPECT_NE(error_of([&] { prepare_surface(raw, options); }).field().find("column 5, row 4"),
              std::string::npos);
    options.crop = {0, 0, 8, 4};  // cropped away
    EXPECT_NO_THROW(prepare_surface(raw, options));
}

TEST(Missing, InfinityIsRefusedEvenWhenInterpolating) {
    RawHeights raw = raw_grid(3, 3, numbered);
    raw.values[4] = INFINITY;
    PrepareOptions options;
    options.missing = Missing::interpolate;
    EXPECT_NE(error_of([&] { prepare_surface(raw, options); }).field().find("column 1, row 1"),
              std::string::npos);
}

TEST(Missing, HarmonicFillReproducesHarmonicFunctions) {
    // x y and x^2 - y^2 satisfy the discrete Laplace equation exactly. Holes touch neither each other nor the
    // edges.
    auto harmonic = [](int i, int j) {
        return 3 + 0.2 * i - 0.1 * j + 0.01 * i * j + 0.02 * (i * i - j * j);
    };
    RawHeights raw = raw_grid(40, 30, harmonic);
    int removed = 0;
    for (int j = 0; j < 30; ++j)
        for (int i = 0; i < 40; ++i)
            if ((std::abs(i - 12) < 7 && std::abs(j - 14) < 9) || (i == 30 && j > 3 && j < 20)) {
                raw.values[j * 40 + i] = std::nan("");
                ++removed;
            }
    PrepareOptions options;
    options.missing = Missing::interpolate;
    const PreparedSurface p = prepare_surface(raw, options);
    for (int j = 0; j < 30; ++j)
        for (int i = 0; i < 40; ++i) EXPECT_NEAR(height(p, i, j), harmonic(i, j), 1e-5);
    EXPECT_TRUE(notes_contain(p, std::to_string(removed) + " missing points interpolated"));
}

TEST(Missing, FillAtAnEdgeIsNotPulledAcrossTheSeam) {
    // The left half is 0, the right half 10; the missing last column must continue 10, not average with the
    // first.
    RawHeights raw = raw_grid(10, 4, [](int i, int) { return i < 5 ? 0.0 : i == 9 ? std::nan("") : 10.0; });
    PrepareOptions options;
    options.missing = Missing::interpolate;
    const PreparedSurface p = prepare_surface(raw, options);
    for (int j = 0; j < 4; ++j) EXPECT_NEAR(height(p, 9, j), 10, 1e-6);
}

TEST(Missing, NothingKnownIsAnError) {
    const RawHeights raw = raw_grid(3, 3, [](int, int) { return std::nan(""); });
    PrepareOptions options;
    options.missing = Missing::interpolate;
    EXPECT_EQ(error_of([&] { prepare_surface(raw, options); }).field(), "/surface");
}

TEST(Level, RecoversAPlantedPlaneAndQuadric) {
    const int nx = 50, ny = 31;
    const double px = 0.5, py = 2;
    auto relief = [&](int i, int j) {
        return 0.01 * std::sin(2 * pi * 5 * i / nx) * std::sin(2 * pi * 3 * (j + 0.5) / ny);
    };
    auto x = [&](int i) { return (i - (nx - 1) / 2.0) * px; };
    auto y = [&](int j) { return (j - (ny - 1) / 2.0) * py; };
    RawHeights base = raw_grid(nx, ny, relief);
    base.pitch_x = px, base.pitch_y = py;
    for (const Level level : {Level::mean, Level::plane, Level::quadratic}) {
        RawHeights raw = base;
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) {
                double form = 7;
                if (level != Level::mean) form += 0.03 * x(i) - 0.02 * y(j);
                if (level == Level::quadratic)
                    form += 0.004 * x(i) * x(i) + 0.001 * x(i) * y(j) - 0.002 * y(j) * y(j);
                raw.values[j * nx + i] += form;
            }
        PrepareOptions options;
        options.level = level;
        const PreparedSurface with_form = prepare_surface(raw, options),
                              without = prepare_surface(base, options);
        EXPECT_NEAR(with_form.surface.mean_height, 0, 1e-12);
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) ASSERT_NEAR(height(with_form, i, j), height(without, i, j), 1e-8);
        if (level != Level::mean) {  // what is left of the relief after its own plane is still most of it
            EXPECT_NEAR(surface_statistics(with_form.surface).sq, 0.005, 1e-3);
        }
    }
    RawHeights tilted = raw_grid(nx, ny, [&](int i, int j) { return 0.25 * i - 0.5 * j; });
    PrepareOptions options;
    options.level = Level::plane;
    const PreparedSurface p = prepare_surface(tilted, options);
    EXPECT_TRUE(notes_contain(p, "slopes 0.25 in x, -0.5 in y")) << p.notes.back();
    EXPECT_NEAR(surface_statistics(p.surface).sq, 0, 1e-7);
    options.level = Level::quadratic;
    const RawHeights bowl =
        raw_grid(nx, ny, [&](int i, int j) { return 0.5 * (0.02 * x(i) * x(i) + 0.04 * y(j) * y(j)) / 1.0; });
    RawHeights bowl_metres = bowl;
    bowl_metres.pitch_x = px, bowl_metres.pitch_y = py;
    EXPECT_TRUE(notes_contain(prepare_surface(bowl_metres, options), "curvatures 0.02/m in x, 0.04/m in y"));
}

TEST(Level, OneRowAndOneColumnAreFine) {
    for (const Level level : {Level::mean, Level::plane, Level::quadratic}) {
        PrepareOptions options;
        options.level = level;
        for (const auto& [nx, ny] :
             {std::pair(1, 1), std::pair(2, 1), std::pair(1, 2), std::pair(2, 2), std::pair(9, 1)}) {
            const PreparedSurface p = prepare_surface(raw_grid(nx, ny, numbered), options);
            if (level != Level::mean) {
                EXPECT_NEAR(surface_statistics(p.surface).sq, 0, 1e-6) << nx << " x " << ny;
            }
        }
    }
}

TEST(Resample, DownIsTheBoxAverage) {
    PrepareOptions options;
    options.resample = {2, 3};
    const PreparedSurface p = prepare_surface(raw_grid(4, 6, numbered), options);
    ASSERT_EQ(p.surface.nx, 2);
    ASSERT_EQ(p.surface.ny, 3);
    EXPECT_EQ(p.surface.pitch_x, 2);
    EXPECT_EQ(p.surface.pitch_y, 2);
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 2; ++i) EXPECT_NEAR(height(p, i, j), numbered(2 * i, 2 * j) + 5.5, 1e-5);
}

TEST(Resample, FractionalBoxesKeepTheMean) {
    auto wavy = [](int i, int j) { return std::sin(1.3 * i + 0.2) * std::cos(0.9 * j); };
    const PreparedSurface whole = prepare_surface(raw_grid(50, 37, wavy), {});
    PrepareOptions options;
    options.resample = {33, 11};
    EXPECT_NEAR(prepare_surface(raw_grid(50, 37, wavy), options).surface.mean_height,
                whole.surface.mean_height, 1e-12);
}

TEST(Resample, UpKeepsNodesAndIsBilinearAndPeriodicBetween) {
    const RawHeights raw = raw_grid(4, 1, [](int i, int) { return std::array{0.0, 1.0, 4.0, 9.0}[i]; });
    PrepareOptions options;
    options.resample = {8, 1};
    PreparedSurface p = prepare_surface(raw, options);
    const double periodic[] = {0, 0.5, 1, 2.5, 4, 6.5, 9, 4.5};
    for (int i = 0; i < 8; ++i) EXPECT_NEAR(height(p, i, 0), periodic[i], 1e-6);
    EXPECT_EQ(p.surface.pitch_x, 0.5);
    options.boundary = Boundary::open;
    EXPECT_NEAR(height(prepare_surface(raw, options), 7, 0), 9, 1e-6);  // not averaged with the other side
}

TEST(Resample, ImpossibleSizesAreRefused) {
    for (const std::array<int, 2>& size : {std::array{0, 4}, {4, -1}, {65537, 1}, {65536, 65536}}) {
        PrepareOptions options;
        options.resample = size;
        EXPECT_EQ(error_of([&] { prepare_surface(raw_grid(4, 4, numbered), options); }).field(),
                  "/surface/resample");
    }
}

TEST(Boundary, MirrorIsSymmetricSeamlessAndTwiceAsWide) {
    PrepareOptions options;
    options.boundary = Boundary::mirror;
    const PreparedSurface p = prepare_surface(raw_grid(5, 3, numbered), options);
    ASSERT_EQ(p.surface.nx, 10);
    ASSERT_EQ(p.surface.ny, 6);
    for (int j = 0; j < 6; ++j)
        for (int i = 0; i < 10; ++i) {
            EXPECT_EQ(p.surface.at(i, j), p.surface.at(9 - i, j));
            EXPECT_EQ(p.surface.at(i, j), p.surface.at(i, 5 - j));
        }
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 5; ++i) EXPECT_NEAR(height(p, i, j), numbered(i, j), 1e-5);
    const SurfaceStatistics t = surface_statistics(p.surface);
    EXPECT_EQ(t.wrap_jump_x, 0);
    EXPECT_TRUE(notes_contain(p, "period doubles"));
    EXPECT_EQ(prepare_surface(raw_grid(5, 1, numbered), options).surface.ny, 1);
}

TEST(Boundary, OpenKeepsABorderOfTheReachOf75Degrees) {
    // Range 2 over a pitch of 1: 2 tan 75 = 7.46, so 8 cells; of 100 cells that is 16 %, of 8 cells a
    // quarter.
    PrepareOptions options;
    options.boundary = Boundary::open;
    PreparedSurface p = prepare_surface(raw_grid(100, 8, [](int i, int) { return i % 2 * 2.0; }), options);
    EXPECT_EQ(p.surface.border_x, 8);
    EXPECT_EQ(p.surface.border_y, 2);
    EXPECT_TRUE(notes_contain(p, "58 % of the area")) << p.notes.back();  // 1 - 0.84 * 0.5
    p = prepare_surface(raw_grid(100, 1, numbered), options);
    EXPECT_EQ(p.surface.border_y, 0);
    EXPECT_EQ(p.surface.border_x, 25);
}

TEST(Prepare, RefusesSizesThatDoNotMatch) {
    RawHeights raw = raw_grid(4, 4, numbered);
    raw.ny = 5;
    EXPECT_EQ(error_of([&] { prepare_surface(raw, {}); }).field(), "/surface");
    raw.nx = raw.ny = std::numeric_limits<int>::max();
    EXPECT_EQ(error_of([&] { prepare_surface(raw, {}); }).code(), ErrorCode::limit);
    PrepareOptions options;
    options.height_offset = std::nan("");
    EXPECT_EQ(error_of([&] { prepare_surface(raw_grid(2, 2, numbered), options); }).field(),
              "/surface/height_offset");
}

// ---- Real samples: figures as tests/samples/SOURCES.txt states them, computed independently with NumPy.
// ----

PreparedSurface sample(const std::string& name, PrepareOptions options) {
    return prepare_surface(read_heights(std::string(GONIO_TEST_DATA "/samples/") + name), options);
}

TEST(Samples, AfmScanHasItsKnownRoughness) {
    PrepareOptions options;
    options.boundary = Boundary::open;
    const PreparedSurface p = sample("afm_rough.gsf", options);
    const SurfaceStatistics t = surface_statistics(p.surface);
    EXPECT_NEAR(t.pitch_x, 39.0625e-9, 1e-15);
    EXPECT_NEAR(t.sq, 35.2229e-9, 1e-13);
    EXPECT_NEAR(t.rms_slope_x, 0.132648, 1e-5);
    EXPECT_NEAR(t.rms_slope_y, 0.139247, 1e-5);
    EXPECT_GT(t.wrap_jump_x, 5);
}

TEST(Samples, AfmTextExportHoldsTheSameNumbersAsTheGsf) {
    const RawHeights text = read_heights(GONIO_TEST_DATA "/samples/afm_rough_64rows.txt");
    const RawHeights gsf = read_heights(GONIO_TEST_DATA "/samples/afm_rough.gsf");
    ASSERT_EQ(text.nx, 256);
    ASSERT_EQ(text.ny, 64);
    EXPECT_NEAR(*text.pitch_x, *gsf.pitch_x, 1e-15);
    EXPECT_NEAR(*text.pitch_y, *gsf.pitch_y, 1e-15);
    EXPECT_EQ(text.height_unit, gsf.height_unit);
    for (size_t k = 0; k < text.values.size(); ++k)
        ASSERT_EQ(static_cast<float>(text.values[k]), static_cast<float>(gsf.values[k])) << k;
}

TEST(Samples, MachinedGroovesAreAnisotropicOnANonSquareGrid) {
    PrepareOptions options;
    options.boundary = Boundary::open;
    const SurfaceStatistics t = surface_statistics(sample("machined_grooves_256.gsf", options).surface);
    EXPECT_NEAR(t.pitch_x, 0.127656509837346e-6, 1e-14);
    EXPECT_NEAR(t.pitch_y, 0.314582113527746e-6, 1e-14);
    EXPECT_NEAR(t.sq, 92.8635e-9, 1e-12);
    EXPECT_NEAR(t.rms_slope_x, 0.061416, 1e-5);
    EXPECT_NEAR(t.rms_slope_y, 0.030891, 1e-5);
}

TEST(Samples, FujiIsAMountain) {
    PrepareOptions options;
    options.boundary = Boundary::open;
    const SurfaceStatistics t = surface_statistics(sample("fuji_256.gsf", options).surface);
    EXPECT_NEAR(t.sq, 584.212, 1e-2);
    EXPECT_NEAR(t.rms_slope_x, 0.200216, 1e-5);
    EXPECT_NEAR(t.rms_slope_y, 0.187080, 1e-5);
    EXPECT_NEAR(t.height_max, 3750, 30);
}

TEST(Samples, TexturesAreSeamlessAndNeedTheirSizes) {
    for (const auto& [name, bits, sq_stored] :
         {std::tuple("lava_rock_256_16bit.png", 16, 8831.7356), std::tuple("wool_256_8bit.png", 8, 21.126011),
          std::tuple("tiles_256_8bit.png", 8, 48.399495)}) {
        EXPECT_EQ(error_of([&, file = std::string(name)] { sample(file, {}); }).code(),
                  ErrorCode::missing_unit);
        PrepareOptions options;
        options.width = 50e-3, options.height_range = 5e-3;
        const PreparedSurface p = sample(name, options);
        const SurfaceStatistics t = surface_statistics(p.surface);
        EXPECT_EQ(p.stored_bits, bits);
        EXPECT_NEAR(t.sq, sq_stored * 5e-3 / (bits == 8 ? 255 : 65535), 1e-9) << name;
        EXPECT_LT(t.wrap_jump_x, 1.5) << name;
        EXPECT_LT(t.wrap_jump_y, 1.5) << name;
        const auto warnings = surface_warnings(p.surface, t);
        EXPECT_EQ(warnings.size(), bits == 8 ? 1u : 0u) << name;  // terraces and nothing else
    }
}

TEST(Samples, ImagesHaveTheirFirstRowAtTheTop) {
    PrepareOptions options;
    options.width = 1, options.height_scale = 1;
    const PreparedSurface p = sample("lava_rock_256_16bit.png", options);
    EXPECT_NEAR(height(p, 0, 255), 8338, 0.01);  // the file's first and last rows begin 8338, 9187
    EXPECT_NEAR(height(p, 0, 0), 9187, 0.01);
}

}  // namespace
}  // namespace gonio
