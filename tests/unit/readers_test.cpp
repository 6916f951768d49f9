// Each reader against bytes written here, then against hostile bytes: every one either reads right or throws
// Error.
#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFloatAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <png.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>

#include "surface/io/formats.h"

namespace gonio {
namespace {

constexpr ReadLimits limits{};

RawHeights decode(const std::string& name, const std::string& bytes) {
    return decode_heights({name, bytes}, limits);
}

Error error_of(const std::string& name, const std::string& bytes, const ReadLimits& within = limits) {
    try {
        decode_heights({name, bytes}, within);
    } catch (const Error& error) {
        EXPECT_EQ(error.field(), name);
        return error;
    }
    ADD_FAILURE() << "no error was thrown";
    return {ErrorCode::internal, "", "", ""};
}

template <class T>
std::string raw_bytes(const std::vector<T>& values, bool big_endian = false) {
    std::string bytes;
    for (const T value : values) {
        std::string one(reinterpret_cast<const char*>(&value), sizeof(T));
        if (big_endian == (std::endian::native == std::endian::little)) std::reverse(one.begin(), one.end());
        bytes += one;
    }
    return bytes;
}

// Whatever is cut off a file, the reader must refuse it. step: how many bytes between cuts.
void expect_every_truncation_refused(const std::string& name, const std::string& bytes, size_t step = 1) {
    for (size_t size = 0; size < bytes.size(); size += step)
        EXPECT_THROW(decode(name, bytes.substr(0, size)), Error)
            << name << " cut to " << size << " of " << bytes.size();
}

// ---- GSF ----

std::string gsf(const std::string& header, const std::vector<float>& values) {
    std::string text = "Gwyddion Simple Field 1.0\n" + header;
    text.append(4 - text.size() % 4, '\0');
    return text + raw_bytes(values);
}

const std::string gsf_header =
    "XRes = 3\nYRes = 2\nXReal = 6\nYReal = 8\nXYUnits = um\nZUnits = nm\nTitle = test\n";

TEST(Gsf, ReadsSizesUnitsAndRows) {
    for (const char* padding : {"", "A = b\n", "A = bc\n", "A = bcd\n"}) {  // 1 to 4 NULs
        const RawHeights raw = decode("a.gsf", gsf(gsf_header + padding, {1, 2, 3, 4, NAN, 6}));
        EXPECT_EQ(raw.nx, 3);
        EXPECT_EQ(raw.ny, 2);
        EXPECT_DOUBLE_EQ(*raw.pitch_x, 2e-6);
        EXPECT_DOUBLE_EQ(*raw.pitch_y, 4e-6);
        EXPECT_EQ(raw.height_unit, 1e-9);
        EXPECT_TRUE(raw.row0_at_top);
        EXPECT_EQ(raw.values[3], 4);
        EXPECT_TRUE(std::isnan(raw.values[4]));
        EXPECT_EQ(raw.bits, 0);
        EXPECT_EQ(raw.format, "gsf");
    }
}

TEST(Gsf, UnitsThatTheFileDoesNotCarryStayEmpty) {
    RawHeights raw = decode("a.gsf", gsf("XRes = 1\nYRes = 1\nXReal = 5\nYReal = 5\n", {1}));
    EXPECT_FALSE(raw.pitch_x || raw.pitch_y || raw.height_unit);
    raw = decode("a.gsf", gsf("XRes = 1\nYRes = 1\nXYUnits = m\nZUnits = V\n", {1}));
    EXPECT_FALSE(raw.pitch_x || raw.pitch_y || raw.height_unit);
    ASSERT_EQ(raw.notes.size(), 1u);
    EXPECT_NE(raw.notes[0].find("'V'"), std::string::npos);
    raw = decode("a.gsf", gsf("XRes = 1\nYRes = 1\nXReal = -5\nYReal = nan\nXYUnits = m\n", {1}));
    EXPECT_FALSE(raw.pitch_x || raw.pitch_y);
}

TEST(Gsf, MicrometresInEverySpelling) {
    for (const char* unit : {"um", "\xc2\xb5m", "\xce\xbcm", "\xb5m"}) {
        const RawHeights raw = decode(
            "a.gsf",
            gsf("XRes = 1\nYRes = 1\nXReal = 5\nYReal = 5\nXYUnits = " + std::string(unit) + "\n", {1}));
        EXPECT_DOUBLE_EQ(raw.pitch_x.value_or(0), 5e-6) << unit;
    }
}

TEST(Gsf, HostileFilesAreRefused) {
    expect_every_truncation_refused("a.gsf", gsf(gsf_header, {1, 2, 3, 4, 5, 6}));
    error_of("a.gsf", gsf(gsf_header, {1, 2, 3, 4, 5, 6, 7}));
    for (const char* sizes :
         {"XRes = 4294967296\nYRes = 4294967296\n", "XRes = 2147483647\nYRes = 2147483647\n",
          "XRes = -3\nYRes = -2\n", "XRes = 0\nYRes = 0\n", "XRes = 3.5\nYRes = 2\n",
          "XRes = 99999999999999999999\nYRes = 1\n", "YRes = 2\n", "XRes = 1000000\nYRes = 200\n",
          "no equals sign\n"})
        error_of("a.gsf", gsf(sizes, {1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(error_of("a.gsf", gsf(gsf_header, {1, 2, 3, 4, 5, 6}), {.max_points = 5}).code(),
              ErrorCode::limit);
    EXPECT_EQ(error_of("a.gsf", gsf("XRes = 1000000\nYRes = 1000000\n", {1})).code(), ErrorCode::limit);
}

// ---- NPY ----

std::string npy(const std::string& dictionary, const std::string& data, int version = 1) {
    std::string bytes = "\x93NUMPY";
    bytes += static_cast<char>(version);
    bytes += '\0';
    if (version == 1)
        bytes += raw_bytes(std::vector<uint16_t>{static_cast<uint16_t>(dictionary.size())});
    else
        bytes += raw_bytes(std::vector<uint32_t>{static_cast<uint32_t>(dictionary.size())});
    return bytes + dictionary + data;
}

std::string dictionary(const std::string& type, bool fortran, const std::string& shape) {
    return "{'descr': '" + type + "', 'fortran_order': " + (fortran ? "True" : "False") +
           ", 'shape': " + shape + ", }   \n";
}

template <class T>
void expect_type(const std::string& name, bool big_endian) {
    const RawHeights raw = decode("a.npy", npy(dictionary((big_endian ? ">" : "<") + name, false, "(2, 3)"),
                                               raw_bytes(std::vector<T>{1, 2, 3, 4, 5, 60}, big_endian)));
    EXPECT_EQ(raw.values, (std::vector<double>{1, 2, 3, 4, 5, 60})) << name;
    EXPECT_EQ(raw.nx, 3);
    EXPECT_EQ(raw.ny, 2);
    EXPECT_FALSE(raw.row0_at_top);
    EXPECT_FALSE(raw.pitch_x || raw.pitch_y || raw.height_unit);
    EXPECT_EQ(raw.integer_max, name == "u1" ? 255 : name == "u2" ? 65535 : 0);
}

TEST(Npy, EveryTypeInBothByteOrders) {
    for (const bool big_endian : {false, true}) {
        expect_type<float>("f4", big_endian);
        expect_type<double>("f8", big_endian);
        expect_type<int8_t>("i1", big_endian);
        expect_type<int16_t>("i2", big_endian);
        expect_type<int32_t>("i4", big_endian);
        expect_type<int64_t>("i8", big_endian);
        expect_type<uint8_t>("u1", big_endian);
        expect_type<uint16_t>("u2", big_endian);
        expect_type<uint32_t>("u4", big_endian);
        expect_type<uint64_t>("u8", big_endian);
    }
    EXPECT_EQ(decode("a.npy", npy(dictionary("|u1", false, "(1, 2)"), "\x01\xff")).values,
              (std::vector<double>{1, 255}));
    EXPECT_EQ(decode("a.npy", npy(dictionary("|i1", false, "(1, 2)"), "\x01\xff")).values,
              (std::vector<double>{1, -1}));
}

TEST(Npy, HalfFloats) {
    const std::vector<uint16_t> halves{0x3c00, 0xc000, 0x0001, 0x7bff, 0x8000, 0x3555};
    const RawHeights raw = decode("a.npy", npy(dictionary("<f2", false, "(2, 3)"), raw_bytes(halves)));
    EXPECT_EQ(raw.values, (std::vector<double>{1, -2, 0x1p-24, 65504, -0.0, 1365.0 / 4096}));
    const RawHeights special = decode(
        "a.npy", npy(dictionary("<f2", false, "(1, 2)"), raw_bytes(std::vector<uint16_t>{0x7c00, 0x7e00})));
    EXPECT_TRUE(std::isinf(special.values[0]));
    EXPECT_TRUE(std::isnan(special.values[1]));
}

TEST(Npy, FortranOrderAndVersions) {
    const std::string data = raw_bytes(std::vector<float>{1, 4, 2, 5, 3, 6});
    for (const int version : {1, 2, 3})
        EXPECT_EQ(decode("a.npy", npy(dictionary("<f4", true, "(2, 3)"), data, version)).values,
                  (std::vector<double>{1, 2, 3, 4, 5, 6}));
}

TEST(Npy, HostileFilesAreRefused) {
    const std::string data = raw_bytes(std::vector<float>{1, 2, 3, 4, 5, 6});
    expect_every_truncation_refused("a.npy", npy(dictionary("<f4", false, "(2, 3)"), data));
    expect_every_truncation_refused("a.npy", npy(dictionary("<f4", false, "(2, 3)"), data, 3));
    error_of("a.npy", npy(dictionary("<f4", false, "(2, 3)"), data + "x"));
    for (const char* shape : {"(6,)", "()", "(1, 2, 3)", "(-2, -3)", "(0, 3)", "(4294967296, 4294967296)",
                              "(9223372036854775807, 2)", "(99999999999999999999, 1)", "6", "(2 3)", "(2, 3"})
        error_of("a.npy", npy(dictionary("<f4", false, shape), data));
    for (const char* type : {"<c8", "<f3", "<U4", "|b1", "<f16", "f4", "<m8", ""})
        error_of("a.npy", npy(dictionary(type, false, "(2, 3)"), data));
    error_of("a.npy", npy("", data));
    error_of("a.npy", npy("{'descr': ", data));
    error_of("a.npy", npy(dictionary("<f4", false, "(2, 3)"), data, 4));
    EXPECT_EQ(error_of("a.npy", npy(dictionary("<f4", false, "(2, 3)"), data), {.max_points = 5}).code(),
              ErrorCode::limit);
}

// ---- PFM ----

TEST(Pfm, BothByteOrdersRowsFromTheBottom) {
    for (const bool big_endian : {false, true}) {
        const std::string bytes = std::string("Pf\n3 2\n") + (big_endian ? "1.0\n" : "-1.0\n") +
                                  raw_bytes(std::vector<float>{1, 2, 3, 4, 5, NAN}, big_endian);
        const RawHeights raw = decode("a.pfm", bytes);
        EXPECT_EQ(raw.nx, 3);
        EXPECT_EQ(raw.ny, 2);
        EXPECT_EQ(raw.values[1], 2);
        EXPECT_TRUE(std::isnan(raw.values[5]));
        EXPECT_FALSE(raw.row0_at_top);
        EXPECT_TRUE(raw.notes.empty());
        expect_every_truncation_refused("a.pfm", bytes);
    }
    EXPECT_EQ(decode("a.pfm", "Pf\n1 1\n-2.5\n" + raw_bytes(std::vector<float>{7})).notes.size(), 1u);
}

TEST(Pfm, HostileFilesAreRefused) {
    const std::string data = raw_bytes(std::vector<float>{1, 2, 3, 4, 5, 6});
    for (const char* header : {"PF\n3 2\n-1\n", "Pf\n-3 -2\n-1\n", "Pf\n4294967296 4294967296\n-1\n",
                               "Pf\n3 2\n0\n", "Pf\n3 2\nnan\n", "Pf\n3 x\n-1\n", "Pf\n", "Px\n3 2\n-1\n"})
        error_of("a.pfm", header + data);
}

// ---- Text ----

TEST(Text, BareMatricesWithEverySeparator) {
    for (const char* text : {"1 2 3\n4 5 6\n", "1\t2\t3\n4\t5\t6", "1,2,3\r\n4,5,6\r\n",
                             "1, 2, 3,\n4, 5, 6,\n", "1;2;3\n4;5;6\n", "  1  2\t3  \n\n# comment\n4 5 6\n\n",
                             "\xef\xbb\xbf"
                             "1 2 3\n+4 5.0 6e0\n"}) {
        const RawHeights raw = decode("a.txt", text);
        EXPECT_EQ(raw.nx, 3) << text;
        EXPECT_EQ(raw.values, (std::vector<double>{1, 2, 3, 4, 5, 6})) << text;
        EXPECT_FALSE(raw.pitch_x || raw.pitch_y || raw.height_unit || raw.row0_at_top);
        EXPECT_EQ(raw.format, "text");
    }
}

TEST(Text, GwyddionExportCarriesItsUnits) {
    const RawHeights raw = decode("a.txt",
                                  "# Channel: ZSensor\n# Width: 10.00 \xc2\xb5m\n# Height: 4 nm\n# Value "
                                  "units: mm\n1.8823e-008\t2\n3\t4\n");
    EXPECT_DOUBLE_EQ(*raw.pitch_x, 5e-6);
    EXPECT_DOUBLE_EQ(*raw.pitch_y, 2e-9);
    EXPECT_EQ(raw.height_unit, 1e-3);
    EXPECT_EQ(raw.values[0], 1.8823e-8);
    EXPECT_TRUE(raw.notes.empty());
    const RawHeights volts = decode("a.txt", "# Width: 10 parsec\n# Value units: V\n1 2\n");
    EXPECT_FALSE(volts.pitch_x || volts.height_unit);
    EXPECT_EQ(volts.notes.size(), 2u);
}

TEST(Text, MissingPoints) {
    const RawHeights raw = decode("a.csv", "1,,3\nnan,5,NaN\n");
    EXPECT_EQ(raw.nx, 3);
    EXPECT_TRUE(std::isnan(raw.values[1]) && std::isnan(raw.values[3]) && std::isnan(raw.values[5]));
}

TEST(Text, HostileFilesAreRefusedWithTheLine) {
    for (const auto& [text, words] : {std::pair("1 2\n3\n", "line 2"),
                                      {"1 2\n3 4 5\n", "line 2"},
                                      {"1 2\n3 x\n", "'x' in line 2, field 2"},
                                      {"1,5\t2,5\n", "decimal"},
                                      {"1,5;2,5\n", "decimal"},
                                      {"", "no numbers"},
                                      {"\n\n# only comments\n", "no numbers"},
                                      {"1 2\n3 1e999\n", "1e999"},
                                      {"1 2\n3 0x10\n", "0x10"},
                                      {"1 2\n3 --4\n", "--4"},
                                      {"1 +-2\n", "+-2"}}) {
        const Error e = error_of("a.txt", text);
        EXPECT_NE(std::string(e.what()).find(words), std::string::npos) << e.what();
    }
    error_of("a.txt", std::string("1 2\0 3\n", 7));
    EXPECT_EQ(error_of("a.txt", "1 2 3\n4 5 6\n", {.max_points = 5}).code(), ErrorCode::limit);
}

// ---- PNG ----

void append_bytes(png_structp png, png_bytep data, size_t size) {
    static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<char*>(data), size);
}

// samples: row by row, pixel by pixel, channel by channel.
std::string png(int nx, int ny, int colour, int bits, const std::vector<uint16_t>& samples,
                const std::function<void(png_structp, png_infop)>& extra = {}) {
    std::string bytes;
    png_structp handle = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(handle);
    png_set_write_fn(handle, &bytes, append_bytes, nullptr);
    png_set_IHDR(handle, info, nx, ny, bits, colour, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    if (extra) extra(handle, info);
    png_write_info(handle, info);
    const size_t per_row = samples.size() / ny;
    for (int j = 0; j < ny; ++j) {
        std::vector<unsigned char> row;
        for (size_t k = 0; k < per_row; ++k) {
            const uint16_t v = samples[j * per_row + k];
            if (bits == 16) row.push_back(static_cast<unsigned char>(v >> 8));
            row.push_back(static_cast<unsigned char>(v));
        }
        png_write_row(handle, row.data());
    }
    png_write_end(handle, info);
    png_destroy_write_struct(&handle, &info);
    return bytes;
}

TEST(Png, GreyOfEightAndSixteenBits) {
    RawHeights raw = decode("a.png", png(3, 2, PNG_COLOR_TYPE_GRAY, 8, {0, 1, 2, 3, 4, 255}));
    EXPECT_EQ(raw.values, (std::vector<double>{0, 1, 2, 3, 4, 255}));
    EXPECT_EQ(raw.bits, 8);
    EXPECT_EQ(raw.integer_max, 255);
    EXPECT_TRUE(raw.row0_at_top);
    EXPECT_FALSE(raw.pitch_x || raw.height_unit);
    raw = decode("a.png", png(3, 2, PNG_COLOR_TYPE_GRAY, 16, {0, 256, 2, 3, 513, 65535}));
    EXPECT_EQ(raw.values, (std::vector<double>{0, 256, 2, 3, 513, 65535}));
    EXPECT_EQ(raw.bits, 16);
    EXPECT_EQ(raw.integer_max, 65535);
}

TEST(Png, GammaIsIgnored) {
    const RawHeights raw =
        decode("a.png", png(2, 1, PNG_COLOR_TYPE_GRAY, 8, {100, 200},
                            [](png_structp p, png_infop i) { png_set_gAMA(p, i, 0.45455); }));
    EXPECT_EQ(raw.values, (std::vector<double>{100, 200}));
}

TEST(Png, ColourMustBeGreyAndTheErrorNamesTerrainRgb) {
    EXPECT_EQ(decode("a.png", png(2, 1, PNG_COLOR_TYPE_RGB, 8, {7, 7, 7, 9, 9, 9})).values,
              (std::vector<double>{7, 9}));
    EXPECT_EQ(decode("a.png", png(2, 1, PNG_COLOR_TYPE_RGB, 16, {700, 700, 700, 9, 9, 9})).values,
              (std::vector<double>{700, 9}));
    const Error e = error_of("a.png", png(2, 1, PNG_COLOR_TYPE_RGB, 8, {7, 7, 7, 1, 134, 160}));
    EXPECT_NE(std::string(e.what()).find("Terrain-RGB"), std::string::npos);
    EXPECT_EQ(e.value(), "column 1, row 0");
    error_of("a.png", png(1, 1, PNG_COLOR_TYPE_RGB, 8, {7, 7, 8}));  // one channel alone
}

TEST(Png, TransparencyAndPalettesAreRefused) {
    EXPECT_EQ(decode("a.png", png(2, 1, PNG_COLOR_TYPE_GRAY_ALPHA, 8, {7, 255, 9, 255})).values,
              (std::vector<double>{7, 9}));
    EXPECT_EQ(decode("a.png", png(1, 1, PNG_COLOR_TYPE_RGB_ALPHA, 16, {7, 7, 7, 65535})).values,
              (std::vector<double>{7}));
    EXPECT_EQ(error_of("a.png", png(2, 1, PNG_COLOR_TYPE_GRAY_ALPHA, 8, {7, 255, 9, 254})).value(),
              "column 1, row 0");
    error_of("a.png", png(1, 1, PNG_COLOR_TYPE_RGB_ALPHA, 16, {7, 7, 7, 0}));
    error_of("a.png", png(2, 1, PNG_COLOR_TYPE_PALETTE, 8, {0, 1}, [](png_structp p, png_infop i) {
                 const png_color colours[2] = {{0, 0, 0}, {255, 255, 255}};
                 png_set_PLTE(p, i, colours, 2);
             }));
    error_of("a.png", png(2, 1, PNG_COLOR_TYPE_GRAY, 8, {0, 1}, [](png_structp p, png_infop i) {
                 png_color_16 transparent{};
                 png_set_tRNS(p, i, nullptr, 0, &transparent);
             }));
}

TEST(Png, ResolutionIsNotedAndNeverUsed) {
    const RawHeights raw =
        decode("a.png", png(1, 1, PNG_COLOR_TYPE_GRAY, 8, {5}, [](png_structp p, png_infop i) {
                   png_set_pHYs(p, i, 2835, 2835, PNG_RESOLUTION_METER);
               }));
    EXPECT_FALSE(raw.pitch_x);
    ASSERT_EQ(raw.notes.size(), 1u);
    EXPECT_NE(raw.notes[0].find("2835"), std::string::npos);
}

TEST(Png, HostileFilesAreRefused) {
    std::vector<uint16_t> samples(40 * 30);
    for (size_t k = 0; k < samples.size(); ++k) samples[k] = static_cast<uint16_t>(k * k);
    const std::string good = png(40, 30, PNG_COLOR_TYPE_GRAY, 16, samples);
    expect_every_truncation_refused("a.png", good, 3);
    for (const size_t at : {size_t(17), size_t(25), good.size() / 2,
                            good.size() - 20}) {  // header and data: a checksum must notice
        std::string bad = good;
        bad[at] = static_cast<char>(bad[at] ^ 0x40);
        error_of("a.png", bad);
    }
    EXPECT_EQ(error_of("a.png", good, {.max_points = 1199}).code(), ErrorCode::limit);
}

// ---- OpenEXR ----

struct TemporaryFile {
    std::string path = (std::filesystem::temp_directory_path() /
                        ("gonio_readers_test_" + std::to_string(::getpid()) + ".exr"))
                           .string();
    ~TemporaryFile() { std::filesystem::remove(path); }
    std::string bytes() const {
        std::ifstream stream(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }
};

std::string exr(const std::vector<std::string>& channels, int nx, int ny,
                const std::function<void(Imf::Header&)>& extra = {}, Imf::PixelType type = Imf::FLOAT) {
    const TemporaryFile file;
    std::vector<float> values(nx * ny);
    for (int k = 0; k < nx * ny; ++k) values[k] = static_cast<float>(k) + 0.5f;
    std::vector<half> halves(values.begin(), values.end());
    Imf::Header header(nx, ny);
    if (extra) extra(header);
    Imf::FrameBuffer frame;
    const Imath::Box2i& window = header.dataWindow();
    for (const std::string& name : channels) {
        header.channels().insert(name, Imf::Channel(type));
        frame.insert(name,
                     type == Imf::FLOAT
                         ? Imf::Slice::Make(type, values.data(), window, sizeof(float), sizeof(float) * nx)
                         : Imf::Slice::Make(type, halves.data(), window, sizeof(half), sizeof(half) * nx));
    }
    {
        Imf::OutputFile output(file.path.c_str(), header);
        output.setFrameBuffer(frame);
        output.writePixels(ny);
    }
    return file.bytes();
}

TEST(Exr, ReadsPixelsAndAttributes) {
    const RawHeights raw = decode("a.exr", exr({"Y"}, 3, 2, [](Imf::Header& h) {
                                      h.dataWindow() = Imath::Box2i({-5, 7}, {-3, 8});
                                      h.insert("pixelPitchX_m", Imf::FloatAttribute(2e-6f));
                                      h.insert("pixelPitchY_m", Imf::DoubleAttribute(3e-6));
                                      h.insert("heightUnit_m", Imf::StringAttribute("1e-9"));
                                  }));
    EXPECT_EQ(raw.values, (std::vector<double>{0.5, 1.5, 2.5, 3.5, 4.5, 5.5}));
    EXPECT_EQ(raw.nx, 3);
    EXPECT_TRUE(raw.row0_at_top);
    EXPECT_FLOAT_EQ(static_cast<float>(*raw.pitch_x), 2e-6f);
    EXPECT_EQ(raw.pitch_y, 3e-6);
    EXPECT_EQ(raw.height_unit, 1e-9);
    EXPECT_TRUE(raw.notes.empty());
    EXPECT_EQ(
        decode("a.exr",
               exr({"Y"}, 1, 1, [](Imf::Header& h) { h.insert("heightUnit_m", Imf::StringAttribute("um")); }))
            .height_unit,
        1e-6);
}

TEST(Exr, ChoosesTheHeightChannel) {
    for (const auto& names :
         {std::vector<std::string>{"R", "G", "B"}, {"Z"}, {"A", "height"}, {"depth of cut"}, {"A", "Y"}})
        EXPECT_EQ(decode("a.exr", exr(names, 2, 2)).values[3], 3.5) << names[0];
    error_of("a.exr", exr({"A", "B"}, 2, 2));
}

TEST(Exr, HalfFloatsAreNoted) {
    const RawHeights raw = decode("a.exr", exr({"Y"}, 2, 2, {}, Imf::HALF));
    EXPECT_EQ(raw.values[3], 3.5);
    EXPECT_EQ(raw.notes.size(), 1u);
}

TEST(Exr, EveryLosslessCompression) {
    for (const auto compression : {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION,
                                   Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION})
        EXPECT_EQ(decode("a.exr", exr({"Y"}, 70, 50, [=](Imf::Header& h) { h.compression() = compression; }))
                      .values[3499],
                  3499.5);
}

TEST(Exr, HostileFilesAreRefused) {
    const std::string good = exr({"Y"}, 40, 30);
    expect_every_truncation_refused("a.exr", good, 7);
    error_of("a.exr", exr({"Y"}, 1, 1,
                          [](Imf::Header& h) { h.insert("heightUnit_m", Imf::StringAttribute("furlong")); }));
    error_of("a.exr",
             exr({"Y"}, 1, 1, [](Imf::Header& h) { h.insert("pixelPitchX_m", Imf::FloatAttribute(-1)); }));
    EXPECT_EQ(error_of("a.exr", good, {.max_points = 1199}).code(), ErrorCode::limit);
    std::string huge = good;  // the data window's right end
    const size_t window = huge.find("dataWindow");
    ASSERT_NE(window, std::string::npos);
    for (size_t k = window; k + 4 < huge.size(); ++k)
        if (load<int32_t>(&huge[k], false) == 39) {
            huge.replace(k, 4, raw_bytes(std::vector<int32_t>{2000000000}));
            break;
        }
    error_of("a.exr", huge);
}

TEST(Exr, AttributesThatDisagreeWithTheirSizesAreRefusedBeforeTheLibraryReadsThem) {
    // Found by fuzzing: the library lost step with the file and took the next bytes for a size to allocate.
    auto changed = [](const std::string& before_size, uint32_t from, uint32_t to) {
        std::string bytes = exr({"Y"}, 4, 4);
        const size_t at = bytes.find(before_size);
        EXPECT_NE(at, std::string::npos);
        EXPECT_EQ(load<uint32_t>(&bytes[at + before_size.size()], false), from);
        return bytes.replace(at + before_size.size(), 4, raw_bytes(std::vector<uint32_t>{to}));
    };
    const std::string box("displayWindow\0box2i\0", 20), channels("channels\0chlist\0", 16);
    for (const std::string& bytes :
         {changed(box, 16, 17), changed(box, 16, 0), changed(channels, 19, 18), changed(channels, 19, 20)})
        EXPECT_NE(std::string(error_of("a.exr", bytes).what()).find("OpenEXR: an attribute"),
                  std::string::npos);
    const Error e = error_of("a.exr", changed(box, 16, 0x7fffffff));
    EXPECT_NE(std::string(e.what()).find("larger than the file"), std::string::npos) << e.what();
}

// ---- The list ----

TEST(ReadHeights, ContentCountsBeforeTheExtension) {
    EXPECT_EQ(decode("a.txt", gsf("XRes = 1\nYRes = 1\n", {1})).format, "gsf");
    EXPECT_EQ(decode("noextension", png(1, 1, PNG_COLOR_TYPE_GRAY, 8, {1})).format, "png");
    EXPECT_EQ(decode("a.CSV", "1 2\n").format, "text");
    error_of("a.png", "1 2\n");
    error_of("a.exr", "1 2\n");
    error_of("a.npy", "1 2\n");
    error_of("a.gsf", "1 2\n");
    const Error e = error_of("a.jpg", "\xff\xd8\xff");
    EXPECT_NE(std::string(e.what()).find("PNG"), std::string::npos);
}

TEST(ReadHeights, FilesThatAreNotThereOrTooLarge) {
    auto code = [](const std::string& path, const ReadLimits& within) {
        try {
            read_heights(path, within);
        } catch (const Error& e) {
            EXPECT_EQ(e.field(), path);
            return e.code();
        }
        return ErrorCode::internal;
    };
    EXPECT_EQ(code(GONIO_TEST_DATA "/samples/nothing.gsf", {}), ErrorCode::not_found);
    EXPECT_EQ(code(GONIO_TEST_DATA "/samples", {}), ErrorCode::io);
    EXPECT_EQ(code(GONIO_TEST_DATA "/samples/afm_rough.gsf", {.max_bytes = 1000}), ErrorCode::limit);
    EXPECT_EQ(read_heights(GONIO_TEST_DATA "/samples/afm_rough.gsf").nx, 256);
}

}  // namespace
}  // namespace gonio
