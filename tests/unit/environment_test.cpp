// Environments: their files, which way they look, and the irradiance that facets receive from them.
#include "scattering/environment.h"

#include <ImfChannelList.h>
#include <ImfEnvmap.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "directions/direction_set.h"
#include "scattering/environment_slices.h"
#include "surface/generate.h"

namespace gonio {
namespace {

const Monitor no_monitor;
constexpr ReadLimits limits{};

// ---- files ----

std::string hdr(const std::string& pixels, const std::string& size = "-Y 1 +X 2",
                const std::string& lines = "FORMAT=32-bit_rle_rgbe\n") {
    return "#?RADIANCE\n" + lines + "\n" + size + "\n" + pixels;
}
RadianceImage decode(const std::string& bytes) {
    return decode_radiance_image({"sky.hdr", bytes}, limits);
}
std::string message_of(const std::string& bytes) {
    try {
        decode(bytes);
    } catch (const Error& error) {
        EXPECT_EQ(error.field(), "sky.hdr");
        return error.what();
    }
    return "";
}

TEST(RadianceHdr, FlatAndRunLengthCoded) {
    // 128 at exponent 129: (128 + 1/2) / 128; exponent 0 is black.
    const RadianceImage flat = decode(hdr(std::string("\x80\x40\x20\x81\x10\x10\x10\x00", 8)));
    ASSERT_EQ(flat.nx, 2);
    ASSERT_EQ(flat.n_channels, 3);
    EXPECT_EQ(flat.values, (std::vector<float>{128.5f / 128, 0, 64.5f / 128, 0, 32.5f / 128, 0}));
    const RadianceImage exposed = decode(hdr(std::string("\x80\x40\x20\x81\x10\x10\x10\x00", 8), "-Y 1 +X 2",
                                             "EXPOSURE=2\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 2\n"));
    EXPECT_FLOAT_EQ(exposed.values[0], 128.5f / 128 / 4);

    std::string coded("\x02\x02\x00\x0a", 4);  // ten pixels
    coded += std::string("\x8a\x07", 2);       // ten red sevens
    coded +=
        "\x03"
        "abc"
        "\x87\x09";  // three literal, then seven of 9
    coded += std::string("\x8a\x00\x8a\x88", 4);
    const RadianceImage image = decode(hdr(coded, "-Y 1 +X 10"));
    EXPECT_EQ(image.values[9], 7.5f);
    EXPECT_EQ(image.values[12], 'c' + 0.5f);
    EXPECT_EQ(image.values[13], 9.5f);
    EXPECT_EQ(image.values[25], 0.5f);
}

TEST(RadianceHdr, RefusesWhatIsDamaged) {
    std::string coded("\x02\x02\x00\x0a\x8a\x07\x8a\x07\x8a\x07\x8a\x88", 12);
    const std::string good = hdr(coded, "-Y 1 +X 10");
    ASSERT_EQ(message_of(good), "");
    for (size_t size = 0; size < good.size(); ++size) EXPECT_NE(message_of(good.substr(0, size)), "") << size;
    std::string overrun = coded;
    overrun[4] = '\x8b';
    EXPECT_NE(message_of(hdr(overrun, "-Y 1 +X 10")).find("a run does not fit"), std::string::npos);
    overrun[4] = '\x00';
    EXPECT_NE(message_of(hdr(overrun, "-Y 1 +X 10")).find("a run does not fit"), std::string::npos);
    const std::string pixels("\x80\x40\x20\x81\x10\x10\x10\x00", 8);
    EXPECT_NE(message_of(hdr(pixels, "+Y 1 +X 2")).find("-Y rows +X columns"), std::string::npos);
    EXPECT_NE(message_of(hdr(pixels, "-Y 0 +X 2")), "");
    EXPECT_NE(message_of(hdr(pixels, "-Y 100000 +X 100000")), "")
        << "sizes are checked before memory is taken";
    EXPECT_NE(message_of(hdr(pixels, "-Y 1 +X 2", "FORMAT=32-bit_rle_xyze\n")).find("rle_rgbe"),
              std::string::npos);
    EXPECT_NE(message_of(hdr(pixels, "-Y 1 +X 2", "EXPOSURE=0\n")).find("above 0"), std::string::npos);
    EXPECT_NE(message_of("PNG").find("neither OpenEXR nor Radiance"), std::string::npos);
}

std::string write_exr(int nx, int ny, const std::vector<std::string>& names, std::vector<float> planes) {
    const std::string path =
        (std::filesystem::temp_directory_path() / ("environment_" + std::to_string(getpid()) + ".exr"))
            .string();
    Imf::Header header(nx, ny);
    Imf::FrameBuffer frame;
    for (size_t c = 0; c < names.size(); ++c) {
        header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
        frame.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(&planes[c * nx * ny]),
                                          sizeof(float), sizeof(float) * nx));
    }
    {
        Imf::OutputFile out(path.c_str(), header);
        out.setFrameBuffer(frame);
        out.writePixels(ny);
    }
    return path;
}

TEST(RadianceExr, ColoursGreyAndWhatIsRefused) {
    const std::string colour = write_exr(2, 1, {"R", "G", "B", "A"}, {1, 2, 3, 4, 5, 6, 0, 0});
    EXPECT_EQ(read_radiance_image(colour).values, (std::vector<float>{1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(read_radiance_image(write_exr(2, 1, {"Y"}, {7, 8})).values, (std::vector<float>{7, 8}));
    EXPECT_THROW(read_radiance_image(write_exr(2, 1, {"Z"}, {7, 8})), Error);
    EXPECT_THROW(read_radiance_image(write_exr(2, 1, {"Y"}, {7, -8})), Error);
    EXPECT_THROW(read_radiance_image(write_exr(2, 1, {"Y"}, {NAN, 8})), Error);
    std::filesystem::remove(colour);
    EXPECT_THROW(read_radiance_image(colour), Error);
}

// ---- which way it looks ----

// A smooth function of the direction that no axis or sign leaves alone.
double test_light(const Vec3& d) {
    return 2 + d.x + 0.5 * d.y - 0.7 * d.z + 0.3 * d.x * d.y;
}
Imath::V2f pixel(int x, int y) {
    return {static_cast<float>(x), static_cast<float>(y)};
}
// In OpenEXR's frame, whose up is y: its z is our x, its x our y.
Vec3 from_exr(const Imath::V3f& d) {
    return {d.z, d.x, d.y};
}

TEST(Environment, LooksAsOpenExrSays) {
    const Imath::Box2i sphere(Imath::V2i(0, 0), Imath::V2i(511, 255));
    RadianceImage image{512, 256, 1, {}};
    for (int j = 0; j < 256; ++j)
        for (int i = 0; i < 512; ++i)
            image.values.push_back(static_cast<float>(
                test_light(from_exr(Imf::LatLongMap::direction(sphere, pixel(i, j)).normalized()))));
    constexpr int face = 64;
    const Imath::Box2i cube(Imath::V2i(0, 0), Imath::V2i(face - 1, 6 * face - 1));
    RadianceImage cube_image{face, 6 * face, 1, std::vector<float>(6 * face * face)};
    for (int f = 0; f < 6; ++f)
        for (int y = 0; y < face; ++y)
            for (int x = 0; x < face; ++x) {
                const auto d =
                    Imf::CubeMap::direction(static_cast<Imf::CubeMapFace>(f), cube, pixel(x, y)).normalized();
                const Imath::V2f p =
                    Imf::CubeMap::pixelPosition(static_cast<Imf::CubeMapFace>(f), cube, pixel(x, y));
                cube_image.values[std::lround(p.y) * face + std::lround(p.x)] =
                    static_cast<float>(test_light(from_exr(d)));
            }
    const Environment a = make_environment(image, EnvironmentLayout::automatic, 0, 1),
                      b = make_environment(cube_image, EnvironmentLayout::automatic, 0, 1),
                      turned = make_environment(image, EnvironmentLayout::equirectangular, radians(30), 2);
    for (const Vec3& d : slab_directions(200, 0.999, 0.2, 0.4).directions) {
        // OpenEXR puts the centres of the outermost texels on the edges: half a texel of difference.
        EXPECT_NEAR(a.at(0, d), test_light(d), 0.02);
        EXPECT_NEAR(b.at(0, d), test_light(d), 0.05);
        const double c = std::cos(radians(30)), s = std::sin(radians(30));
        EXPECT_NEAR(turned.at(0, {c * d.x - s * d.y, s * d.x + c * d.y, d.z}), 2 * test_light(d), 0.04);
    }
}

TEST(Environment, ShapesAndChannels) {
    const RadianceImage odd{5, 4, 1, std::vector<float>(20, 1)};
    EXPECT_THROW(make_environment(odd, EnvironmentLayout::automatic, 0, 1), Error);
    EXPECT_THROW(make_environment(odd, EnvironmentLayout::cube, 0, 1), Error);
    EXPECT_EQ(make_environment(odd, EnvironmentLayout::equirectangular, 0, 1).nx, 5);
    EXPECT_THROW(make_environment({2, 1, 1, {1e30f, 1}}, EnvironmentLayout::automatic, 0, 1e20), Error);
    const Environment rgb = uniform_environment({1, 2, 3});
    EXPECT_NEAR(for_channels(rgb, 1).at(0, {0, 0, 1}), 0.2126 + 2 * 0.7152 + 3 * 0.0722, 1e-6);
    EXPECT_THROW(for_channels(rgb, 2), Error);
    EXPECT_EQ(for_channels(uniform_environment({4}), 5).at(4, {0, 0, 1}), 4);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(horizontal_irradiance(rgb, c), pi * (c + 1), 1e-6);
}

// ---- irradiance ----

// A sky of few harmonics, with a sun of one texel where asked.
Environment smooth_sky(int nx, double sun) {
    Environment e;
    e.nx = nx, e.ny = nx / 2, e.n_channels = 1, e.rotation = 0.7;
    for (int j = 0; j < e.ny; ++j)
        for (int i = 0; i < e.nx; ++i) {
            const double theta = pi * (j + 0.5) / e.ny, phi = e.rotation + pi * (1 - 2 * (i + 0.5) / e.nx);
            const Vec3 d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
            e.radiance.push_back(
                static_cast<float>(1 + 0.6 * d.x - 0.3 * d.y + 0.5 * d.x * d.z + 0.4 * d.x * d.y));
        }
    if (sun > 0) e.radiance[static_cast<size_t>(e.ny / 4) * e.nx + e.nx / 3] = static_cast<float>(sun);
    return e;
}

Tile whole(const HeightField& s) {
    const CellRect all{0, 0, s.nx, s.ny};
    return make_tile(s, all, all, 1);
}

TEST(SkyIrradiance, OfAPlaneIsExactForAnyNumberOfAzimuths) {
    const HeightField plane = generate_plane(40, 1);
    const MarchGrid grid = make_march_grid(plane);
    const Tile tile = whole(plane);
    const Environment sky = smooth_sky(180, 0);
    for (const int azimuths : {3, 5, 16}) {
        const Fields e = sky_irradiance(grid, tile, sky, {0.3, 0.6},
                                        {.azimuths = azimuths, .shift = 0.3, .horizon = {}}, 1, no_monitor);
        const size_t slot = tile.slot(1, 0, 3);
        EXPECT_NEAR(e.block(0)[slot * column_block] / tile.sqrt_area[slot], horizontal_irradiance(sky, 0),
                    1e-4)
            << azimuths;
    }
}

// Against a sum over 2048 directions that are marched one by one from the same places.
TEST(SkyIrradiance, OfAReliefAgreesWithDependentTests) {
    const HeightField surface = generate_gaussian(48, 40, 1, 6, 0.7, 11);
    const MarchGrid grid = make_march_grid(surface);
    const Tile tile = whole(surface);
    const Environment sky = smooth_sky(180, 0);
    const SubSample place{0.4, 0.2};
    std::vector<double> expected(tile.n_unknowns());
    constexpr int n = 2048;
    const DirectionSet all = slab_directions(2 * n, 0.9999, 0.35, 0.1);
    std::vector<Vec3> upper;
    for (const Vec3& d : all.directions)
        if (d.z > 0) upper.push_back(d);
    for (size_t first = 0; first < upper.size(); first += column_block) {
        const std::vector<Vec3> lights(upper.begin() + first,
                                       upper.begin() + std::min(upper.size(), first + column_block));
        const Irradiance irradiance =
            compute_irradiance(grid, tile, lights, lights, true, {place}, {}, true, 1, no_monitor);
        for (size_t u = 0; u < expected.size(); ++u)
            for (size_t l = 0; l < lights.size(); ++l)
                expected[u] += irradiance.lights.block(0)[u * column_block + l] * sky.at(0, lights[l]) * 2 *
                               pi / static_cast<double>(upper.size());
    }
    const auto compare = [&](const std::vector<double>& truth, const SliceOptions& options) {
        const Fields e = sky_irradiance(grid, tile, sky, place, options, 1, no_monitor);
        double squares = 0, sum = 0, difference = 0;
        for (size_t u = 0; u < truth.size(); ++u) {
            const double d = e.block(0)[u * column_block] - truth[u];
            squares += d * d, difference += d, sum += truth[u];
        }
        return std::pair{std::sqrt(squares * static_cast<double>(truth.size())) / sum, difference / sum};
    };
    const auto [rms, mean] = compare(expected, {.azimuths = 64, .shift = 0.5, .horizon = {.exact = true}});
    EXPECT_LT(rms, 0.003);
    EXPECT_NEAR(mean, 0, 5e-4);

    const Fields many = sky_irradiance(
        grid, tile, sky, place, {.azimuths = 256, .shift = 0.5, .horizon = {.exact = true}}, 1, no_monitor);
    for (size_t u = 0; u < expected.size(); ++u) expected[u] = many.block(0)[u * column_block];
    const auto [few_rms, few_mean] = compare(expected, {.azimuths = 16, .shift = 0.3, .horizon = {}});
    EXPECT_LT(few_rms, 0.006);
    EXPECT_NEAR(few_mean, 0, 3e-4);
}

TEST(KeyLights, TakeTheSunAndLeaveTheSky) {
    const Environment e = smooth_sky(256, 30000);
    const SplitEnvironment split = split_key_lights(e);
    ASSERT_EQ(split.key_lights.size(), 1u);
    const KeyLight& sun = split.key_lights[0];
    double projected = 0;
    for (const double u : {0.25, 0.75})
        for (const double v : {0.25, 0.75}) {
            const Vec3 d = direction_of(e, sun, u, v);
            projected += sun.irradiance[0] * d.z / 4;
            EXPECT_NEAR(dot(d, d), 1, 1e-12);
        }
    EXPECT_NEAR(projected + horizontal_irradiance(split.sky, 0), horizontal_irradiance(e, 0),
                1e-4 * projected);
    // The middle of the texel is where the sun stands in the map.
    EXPECT_NEAR(e.at(0, direction_of(e, sun, 0.5, 0.5)), 30000, 300);
    EXPECT_EQ(split_key_lights(smooth_sky(256, 0)).key_lights.size(), 0u);
    EXPECT_EQ(split_key_lights(smooth_sky(64, 30000)).key_lights.size(), 0u) << "texels of 6 degrees";
}

// Anywhere in the texel, uniform in solid angle.
TEST(KeyLights, FillTheirTexels) {
    Environment e = uniform_environment({1});
    e.nx = 180, e.ny = 90, e.rotation = 0.3;
    const KeyLight light{20, 50, {1}};
    const auto phi = [&](double u) {
        const Vec3 d = direction_of(e, light, u, 0.5);
        return std::atan2(d.y, d.x);
    };
    EXPECT_NEAR(phi(0), 0.3 + pi * (1 - 2 * 50.0 / 180), 1e-12);
    EXPECT_NEAR(phi(0) - phi(1), 2 * pi / 180, 1e-12);
    for (const double v : {0.0, 0.25, 1.0})
        EXPECT_NEAR(direction_of(e, light, 0.5, v).z,
                    (1 - v) * std::cos(pi * 20 / 90) + v * std::cos(pi * 21 / 90), 1e-12);
}

Environment black(int nx, int ny, int n_channels) {
    Environment e;
    e.nx = nx, e.ny = ny, e.n_channels = n_channels;
    e.radiance.assign(static_cast<size_t>(n_channels) * nx * ny, 0.0f);
    return e;
}

// A sun in one channel is one for all; of a hundred lamps the 64 brightest are taken.
TEST(KeyLights, OfAnyColourAndManyLamps) {
    for (int channel = 0; channel < 3; ++channel) {
        Environment e = black(180, 90, 3);
        std::fill(e.radiance.begin(), e.radiance.end(), 0.01f);
        e.radiance[(static_cast<size_t>(channel) * e.ny + 30) * e.nx + 7] = 1000;
        const SplitEnvironment split = split_key_lights(e);
        ASSERT_EQ(split.key_lights.size(), 1u) << channel;
        EXPECT_EQ(split.key_lights[0].row, 30);
        EXPECT_EQ(split.key_lights[0].column, 7);
        for (int c = 0; c < 3; ++c) EXPECT_EQ(split.sky.texel(c, 30, 7), 0);
    }
    Environment lamps = black(180, 90, 1);
    for (int k = 0; k < 100; ++k) lamps.radiance[30 * 180 + k] = 1 + 0.01f * static_cast<float>(k);
    const SplitEnvironment split = split_key_lights(lamps);
    ASSERT_EQ(split.key_lights.size(), 64u);
    for (int k = 0; k < 100; ++k) EXPECT_EQ(split.sky.texel(0, 30, k) == 0, k >= 36) << k;
}

// Rows that the horizon cuts in two, and waves that as many azimuths cannot tell from even light.
TEST(SkyIrradiance, OfCutRowsAndFineWaves) {
    const HeightField plane = generate_plane(4, 1);
    const MarchGrid grid = make_march_grid(plane);
    const Tile tile = whole(plane);
    const auto expect_exact = [&](const Environment& sky, int azimuths) {
        const Fields e = sky_irradiance(grid, tile, sky, {0.3, 0.6},
                                        {.azimuths = azimuths, .shift = 0.3, .horizon = {}}, 1, no_monitor);
        const double expected = horizontal_irradiance(sky, 0);
        ASSERT_GT(expected, 0);
        EXPECT_NEAR(e.block(0)[0] / tile.sqrt_area[0], expected, 1e-3 * expected) << azimuths;
    };
    Environment cut = black(90, 45, 1);
    for (int i = 0; i < cut.nx; ++i) cut.radiance[22 * 90 + i] = 1;
    expect_exact(cut, 8);
    for (const int azimuths : {8, 9}) {
        Environment waves = black(180, 90, 1);
        for (int j = 0; j < 45; ++j)
            for (int i = 0; i < 180; ++i)
                waves.radiance[j * 180 + i] =
                    static_cast<float>(1 + std::cos(2 * pi * (azimuths / 2 + azimuths % 2) * i / 180));
        expect_exact(waves, azimuths);
        // Nor does one azimuth alone see them: on a plane alternating slices would hide it.
        for (const SkySlice& slice : sky_slices(waves, uniform_azimuths(azimuths, 0.3))) {
            double irradiance = 0;
            slice.add(0, {0, 0, 1}, &irradiance);
            EXPECT_NEAR(irradiance, pi / azimuths, 1e-3 * pi / azimuths) << azimuths;
        }
    }
}

// ---- directions for facets that look at one at a time ----

// Mean over shifts of sum of light * weight(direction), and its standard error.
template <class Weight>
std::pair<double, double> integral(const Environment& e, int n, Weight&& weight) {
    constexpr int shifts = 64;
    double sum = 0, squares = 0;
    for (int k = 0; k < shifts; ++k) {
        const EnvironmentSamples samples =
            sample_environment(e, n, (k + 0.5) / shifts, std::fmod(0.37 + k * 0.7548776662, 1.0));
        double one = 0;
        for (int i = 0; i < n; ++i) one += samples.light[0][i] * weight(samples.directions[i]);
        sum += one, squares += one * one;
    }
    const double mean = sum / shifts;
    return {mean, std::sqrt(std::max(0.0, squares / shifts - mean * mean) / (shifts - 1))};
}

TEST(EnvironmentSamples, SumUpToTheLightAbove) {
    Environment odd;  // a row of it lies across the horizon
    odd.nx = 12, odd.ny = 7, odd.n_channels = 1, odd.rotation = 0.7;
    for (int k = 0; k < 84; ++k) odd.radiance.push_back(static_cast<float>(k % 5 * (k % 3)));
    Environment sun = uniform_environment({0.1});
    sun.nx = 90, sun.ny = 45;
    sun.radiance.assign(90 * 45, 0.1f);
    sun.radiance[10 * 90 + 33] = 5000;
    for (const Environment& e : {odd, sun, uniform_environment({2})}) {
        const auto [irradiance, se] = integral(e, 64, [](const Vec3& d) { return d.z; });
        EXPECT_NEAR(irradiance, horizontal_irradiance(e, 0), 4 * se + 1e-5 * irradiance);
        EXPECT_LT(se, 0.02 * irradiance);
    }
    // Of a side, too: azimuths and rotation.
    const Vec3 side = to_vector({60, 130});
    const auto [seen, se] =
        integral(odd, 64, [&](const Vec3& d) { return std::pow(std::max(0.0, dot(d, side)), 3); });
    double expected = 0;
    constexpr int n = 800;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < 4 * n; ++i) {
            const double z = (j + 0.5) / n, r = std::sqrt(1 - z * z), turn = (i + 0.5) / (4 * n),
                         phi = odd.rotation + pi * (1 - 2 * turn);
            const int row = static_cast<int>(std::acos(z) / pi * 7), column = static_cast<int>(turn * 12);
            const Vec3 d{r * std::cos(phi), r * std::sin(phi), z};
            expected += odd.texel(0, row, column) * std::pow(std::max(0.0, dot(d, side)), 3);
        }
    expected *= 2 * pi / (4.0 * n * n);
    EXPECT_NEAR(seen, expected, 4 * se + 2e-3 * expected);
    EXPECT_LT(se, 0.02 * expected);
}

TEST(EnvironmentSamples, GoWhereItIsBright) {
    Environment sun = uniform_environment({0});
    sun.radiance[5] = 10;
    sun.n_channels = 3;
    sun.radiance.resize(96);
    const EnvironmentSamples samples = sample_environment(sun, 100, 0.3, 0.2);
    ASSERT_EQ(samples.light.size(), 3u);
    int lit = 0;
    for (int k = 0; k < 100; ++k) {
        EXPECT_NEAR(dot(samples.directions[k], samples.directions[k]), 1, 1e-12);
        EXPECT_GE(samples.directions[k].z, 1e-4);
        EXPECT_EQ(samples.light[1][k], 0);
        lit += samples.light[0][k] > 0;
    }
    EXPECT_GT(lit, 45);  // half, and a share of the others
    EXPECT_LT(lit, 65);
}

TEST(EnvironmentOfUnitIrradiance, LeavesTheDarkDark) {
    Environment e = uniform_environment({3, 0, 1e30});
    const Environment one = with_unit_irradiance(e);
    EXPECT_NEAR(horizontal_irradiance(one, 0), 1, 1e-5);
    EXPECT_EQ(horizontal_irradiance(one, 1), 0);
    EXPECT_NEAR(horizontal_irradiance(one, 2), 1, 1e-5);
}

}  // namespace
}  // namespace gonio
