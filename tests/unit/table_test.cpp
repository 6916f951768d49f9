// Tables as files: what is written reads back bit-equal, what cannot be written leaves nothing behind, what
// is malformed is refused.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <bit>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <thread>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/random.h"
#include "directions/gonio_grid.h"
#include "table/io/formats.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

namespace fs = std::filesystem;

class TableFiles : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / (std::string("gonio-table-") +
                                               testing::UnitTest::GetInstance()->current_test_info()->name() +
                                               "-" + std::to_string(::getpid()));
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    size_t files() const { return std::distance(fs::directory_iterator(folder_), fs::directory_iterator()); }
    fs::path folder_;
};

// Any finite, non-negative float, from the smallest denormal to the largest: the hard cases of a text format.
float any_float(uint64_t counter) {
    return std::bit_cast<float>(random_words(7, 1, counter)[0] % 0x7f800000u);
}

void fill(Table& table) {
    const size_t n = table.channels.size() * table.slices() * table.rows();
    for (size_t k = 0; k < n; ++k) {
        table.f.push_back(any_float(3 * k));
        table.se.push_back(any_float(3 * k + 1));
        table.bias.push_back(any_float(3 * k + 2));
    }
    table.f[0] = 7.038531e-26f;  // the float that double rounding spoils, see append_number
    table.se[0] = 0;
}

Table product_table(int orders, std::vector<std::string> channels) {
    Table table;
    table.incident = {{0, 0}, {100.0 / 3, -12.5}, {60, 1e-7}};
    table.outgoing = equal_projected_hemisphere(7);
    table.channels = std::move(channels);
    table.orders = orders;
    table.provenance = {{"job_hash", "0123abc"}, {"remark: odd", "two\nlines \\ and: colon"}, {"empty", ""}};
    fill(table);
    return table;
}

Table pair_table(int orders) {
    Table table = product_table(orders, {"r", "g", "b"});
    table.pairs = {{0, 0}, {1, 1}, {1, 2}, {0, 3}, {2, 4}, {2, 0}, {1, 5}, {2, 6}, {2, 6}};
    table.f.clear(), table.se.clear(), table.bias.clear();
    fill(table);
    return table;
}

Table cell_table(int orders) {
    Table table = product_table(orders, {"y"});
    table.cells = equal_cells(9);
    table.outgoing = centres(table.cells);
    table.f.clear(), table.se.clear(), table.bias.clear();
    fill(table);
    return table;
}

void expect_equal(const Table& a, const Table& b) {
    EXPECT_EQ(a.incident, b.incident);
    EXPECT_EQ(a.outgoing, b.outgoing);
    EXPECT_EQ(a.pairs, b.pairs);
    EXPECT_EQ(a.cells, b.cells);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_EQ(a.orders, b.orders);
    EXPECT_EQ(a.f, b.f);
    EXPECT_EQ(a.se, b.se);
    EXPECT_EQ(a.bias, b.bias);
    EXPECT_EQ(a.provenance, b.provenance);
}

TEST_F(TableFiles, TextFormatsReadBackBitEqual) {
    for (const std::string format : {"csv", "json"}) {
        for (const Table& table : {product_table(0, {"y"}), product_table(3, {"450nm", "550.5nm"}),
                                   pair_table(0), pair_table(2), cell_table(0), cell_table(2)}) {
            SCOPED_TRACE(format);
            write_table(table, format, path("t." + format));
            expect_equal(read_table(path("t." + format)), table);
        }
    }
    EXPECT_EQ(files(), 2u);
}

TEST_F(TableFiles, SinglePairAndSingleDirectionReadBack) {
    Table table;
    table.incident = table.outgoing = {{30, 0}};
    table.channels = {"y"};
    table.orders = 2;
    fill(table);
    for (const std::string format : {"csv", "json"}) {
        write_table(table, format, path("t"));
        expect_equal(read_table(path("t")), table);
    }
}

TEST_F(TableFiles, CsvIsTheDocumentedText) {
    Table table;
    table.incident = {{30, 0}};
    table.outgoing = {{0, 0}, {45, 180}};
    table.channels = {"y"};
    table.f = {0.25f, 0.1f}, table.se = {0.5f, 1e-9f}, table.bias = {0, 2};
    table.provenance = {{"seed", "1"}};
    std::ostringstream out;
    write_csv(table, out);
    const std::string text = out.str();
    EXPECT_NE(text.find("no cosine inside"), std::string::npos);
    EXPECT_NE(text.find("\n# seed: 1\n"), std::string::npos);
    EXPECT_EQ(text.substr(text.find("\ntheta") + 1),
              "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f_y,se_y,bias_y\n"
              "30,0,0,0,0.25,0.5,0\n"
              "30,0,45,180,0.1,1e-09,2\n");
}

TEST_F(TableFiles, CsvOfCellsTellsBoundsAndSizes) {
    Table table;
    table.incident = {{30, 0}};
    table.cells = equal_cells(1);
    table.outgoing = centres(table.cells);
    table.channels = {"y"};
    table.f = {0.25f}, table.se = {0.5f}, table.bias = {0};
    std::ostringstream out;
    write_csv(table, out);
    const std::string text = out.str();
    EXPECT_NE(text.find("weighted by the cosine"), std::string::npos);
    EXPECT_EQ(text.substr(text.find("\ntheta") + 1),
              "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,theta_o_min_deg,theta_o_max_deg,phi_o_min_deg,phi_"
              "o_max_deg,"
              "solid_angle_o_sr,projected_solid_angle_o_sr,f_y,se_y,bias_y\n"
              "30,0,0,0,0,90,0,360,6.283185307179585,3.141592653589793,0.25,0.5,0\n");
}

// What readers in other languages do: parse a double, round to float.
TEST_F(TableFiles, NumbersSurviveAReaderThatUsesDoubles) {
    for (uint64_t k = 0; k < 100000; ++k) {
        const float value = k == 0 ? 7.038531e-26f : any_float(k);
        std::string text;
        append_number(text, value);
        ASSERT_EQ(static_cast<float>(std::stod("0" + text)), value) << text;
    }
}

TEST_F(TableFiles, CsvWithoutCommentsIsReadToo) {
    const Table table = parse_table(
        "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f_y,se_y,bias_y\r\n"
        "30,0,0,0,1,2,3\r\n30,0,45,180,4,5,6\r\n",
        "x");
    EXPECT_EQ(table.rows(), 2u);
    EXPECT_TRUE(table.pairs.empty());
    EXPECT_EQ(table.f, (std::vector<float>{1, 4}));
    EXPECT_EQ(table.bias, (std::vector<float>{3, 6}));
}

struct ExrImage {
    std::map<std::string, std::vector<float>> channels;
    std::map<std::string, std::string> attributes;
    int width = 0, height = 0;
};

ExrImage read_exr(const std::string& path) {
    Imf::InputFile file(path.c_str());
    const Imath::Box2i window = file.header().dataWindow();
    ExrImage image;
    image.width = window.max.x + 1, image.height = window.max.y + 1;
    EXPECT_EQ(file.header().compression(), Imf::ZIP_COMPRESSION);
    Imf::FrameBuffer frame;
    for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c) {
        EXPECT_EQ(c.channel().type, Imf::FLOAT);
        auto& pixels = image.channels[c.name()];
        pixels.resize(image.width * image.height);
        frame.insert(c.name(),
                     Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(pixels.data()), 4, 4 * image.width));
    }
    file.setFrameBuffer(frame);
    file.readPixels(0, image.height - 1);
    for (auto a = file.header().begin(); a != file.header().end(); ++a) {
        if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a.attribute()))
            image.attributes[a.name()] = text->value();
    }
    return image;
}

TEST_F(TableFiles, ExrLayersHoldEveryValueAndDirection) {
    Table table = product_table(2, {"r", "g", "b", "450.5nm"});
    table.outgoing = product_grid({10, 20, 30}, {0, 90, 180, 270});
    table.f.clear(), table.se.clear(), table.bias.clear();
    fill(table);
    write_table(table, "exr", path("t.exr"));
    const ExrImage image = read_exr(path("t.exr"));
    EXPECT_EQ(image.width, 4);
    EXPECT_EQ(image.height, 3);
    EXPECT_EQ(image.channels.size(), 2 + table.incident.size() * 4 * 3 * 3);
    EXPECT_EQ(image.attributes.at("i001.thetaI"), "33.333333333333336");
    EXPECT_EQ(image.attributes.at("units"), "1/sr");
    EXPECT_EQ(image.attributes.at("gonio.job_hash"), "0123abc");
    const std::string names[] = {"R", "G", "B", "450,5nm"};
    for (size_t i = 0; i < table.incident.size(); ++i) {
        for (size_t c = 0; c < 4; ++c) {
            for (size_t s = 0; s <= 2; ++s) {
                const std::string layer =
                    "i00" + std::to_string(i) + (s ? ".order" + std::to_string(s) : std::string()) + ".";
                for (size_t o = 0; o < table.outgoing.size(); ++o) {
                    const size_t k = table.index(c, s, i * table.outgoing.size() + o);
                    EXPECT_EQ(image.channels.at(layer + names[c])[o], table.f[k]);
                    EXPECT_EQ(image.channels.at(layer + "stdErr." + names[c])[o], table.se[k]);
                    EXPECT_EQ(image.channels.at(layer + "bias." + names[c])[o], table.bias[k]);
                }
            }
        }
    }
    for (size_t o = 0; o < table.outgoing.size(); ++o) {
        EXPECT_EQ(image.channels.at("thetaO")[o], static_cast<float>(table.outgoing[o].theta_deg));
        EXPECT_EQ(image.channels.at("phiO")[o], static_cast<float>(table.outgoing[o].phi_deg));
    }
}

TEST_F(TableFiles, ExrOfPairsCarriesAllFourAngles) {
    const Table table = pair_table(1);
    write_table(table, "exr", path("t.exr"));
    const ExrImage image = read_exr(path("t.exr"));
    EXPECT_EQ(image.width, 3);  // nine pairs, wrapped
    EXPECT_EQ(image.attributes.at("layout"), "pairs");
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pairs[row];
        EXPECT_EQ(image.channels.at("thetaI")[row], static_cast<float>(table.incident[i].theta_deg));
        EXPECT_EQ(image.channels.at("phiI")[row], static_cast<float>(table.incident[i].phi_deg));
        EXPECT_EQ(image.channels.at("thetaO")[row], static_cast<float>(table.outgoing[o].theta_deg));
        EXPECT_EQ(image.channels.at("G")[row], table.f[table.index(1, 0, row)]);
        EXPECT_EQ(image.channels.at("order1.bias.B")[row], table.bias[table.index(2, 1, row)]);
    }
}

TEST_F(TableFiles, ExrOfManyIncidentDirections) {
    for (const size_t n : {5000u, 6000u}) {  // 3 channels each: below and above the limit of layers
        Table table;
        table.incident = equal_projected_hemisphere(static_cast<int>(n));
        table.outgoing = equal_projected_hemisphere(4);
        table.channels = {"y"};
        fill(table);
        write_table(table, "exr", path("t.exr"));
        const ExrImage image = read_exr(path("t.exr"));
        const size_t row = (n - 1) * 4 + 2;
        if (n == 5000) {
            EXPECT_EQ(image.attributes.at("layout"), "layers");
            EXPECT_EQ(image.channels.at("i4999.Y")[2], table.f[row]);
        } else {
            EXPECT_EQ(image.attributes.at("layout"), "stacked");
            EXPECT_EQ(image.channels.at("Y")[row], table.f[row]);
            EXPECT_EQ(image.channels.at("thetaI")[row], static_cast<float>(table.incident[n - 1].theta_deg));
            EXPECT_EQ(image.channels.at("thetaO")[row], static_cast<float>(table.outgoing[2].theta_deg));
        }
    }
}

TEST_F(TableFiles, TwoMillionRowsInSeconds) {
    Table table;
    table.incident = equal_projected_hemisphere(1000);
    table.outgoing = equal_projected_hemisphere(2000);
    table.channels = {"y"};
    fill(table);
    const auto start = std::chrono::steady_clock::now();
    write_table(table, "csv", path("t.csv"));
    const auto written = std::chrono::steady_clock::now();
    const Table back = read_table(path("t.csv"));
    const auto read = std::chrono::steady_clock::now();
    EXPECT_EQ(back.f, table.f);
    EXPECT_EQ(back.bias, table.bias);
    EXPECT_TRUE(back.pairs.empty());
    const double write_s = std::chrono::duration<double>(written - start).count();
    const double read_s = std::chrono::duration<double>(read - written).count();
    RecordProperty("write_ms", static_cast<int>(1000 * write_s));
    RecordProperty("read_ms", static_cast<int>(1000 * read_s));
    EXPECT_LT(write_s, 20);  // 1-2 s on an idle machine; sanitizers and neighbours take their share
    EXPECT_LT(read_s, 20);
}

std::string contents(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

TEST_F(TableFiles, AFullDiskLeavesTheOldFileAndNothingElse) {
    Table table = product_table(0, {"y"});
    table.incident = equal_projected_hemisphere(300);
    table.outgoing = equal_projected_hemisphere(300);
    table.f.clear(), table.se.clear(), table.bias.clear();
    fill(table);
    rlimit old_limit;
    getrlimit(RLIMIT_FSIZE, &old_limit);
    const auto old_handler =
        std::signal(SIGXFSZ, SIG_IGN);  // write() then fails with EFBIG, as it does with ENOSPC
    for (const std::string& format : table_formats()) {
        std::ofstream(path("t")) << "old";
        const rlimit small{8192, old_limit.rlim_max};
        setrlimit(RLIMIT_FSIZE, &small);
        EXPECT_THROW(write_table(table, format, path("t")), Error) << format;
        setrlimit(RLIMIT_FSIZE, &old_limit);
        EXPECT_EQ(contents(path("t")), "old") << format;
        EXPECT_EQ(files(), 1u) << format;
    }
    std::signal(SIGXFSZ, old_handler);
}

TEST_F(TableFiles, WhatCannotBeWrittenIsAnErrorWithThePath) {
    const Table table = product_table(0, {"y"});
    std::ofstream(path("file")) << "x";
    for (const std::string& format : table_formats()) {
        for (const std::string& bad :
             {path("no/such/folder/t"), path("file") + "/t", folder_.string(), std::string()}) {
            try {
                write_table(table, format, bad);
                ADD_FAILURE() << format << " " << bad;
            } catch (const Error& error) {
                EXPECT_EQ(error.code(), ErrorCode::io) << error.what();
                EXPECT_NE(std::string(error.what()).find(bad), std::string::npos) << error.what();
            }
        }
    }
    EXPECT_THROW(write_table(table, "xls", path("t")), Error);
    EXPECT_EQ(files(), 1u);
}

TEST_F(TableFiles, AWriterThatThrowsLeavesNothing) {
    EXPECT_THROW(write_file_atomically(path("t"),
                                       [](std::ostream& out) {
                                           out << "half";
                                           throw Error(ErrorCode::cancelled, "", "", "stop");
                                       }),
                 Error);
    EXPECT_EQ(files(), 0u);
}

TEST_F(TableFiles, LinksAreWrittenThroughAndModesKept) {
    std::ofstream(path("real")) << "old";
    fs::permissions(path("real"), fs::perms::owner_read | fs::perms::owner_write);
    fs::create_symlink("real", path("link"));
    write_file_atomically(path("link"), [](std::ostream& out) { out << "new"; });
    EXPECT_TRUE(fs::is_symlink(path("link")));
    EXPECT_EQ(contents(path("real")), "new");
    EXPECT_EQ(fs::status(path("real")).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(TableFiles, DevicesAreWrittenDirectly) {
    write_file_atomically("/dev/null", [](std::ostream& out) { out << "gone"; });
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    EXPECT_THROW(write_file_atomically("/dev/full", [](std::ostream& out) { out << "no room"; }), Error);
    EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(TableFiles, ManyWritersOfOneFileNeverMix) {
    std::vector<std::jthread> writers;
    for (int t = 0; t < 4; ++t) {
        writers.emplace_back([&, t] {
            for (int n = 0; n < 20; ++n) {
                write_file_atomically(path("t"), [&](std::ostream& out) {
                    out << std::string(10000, static_cast<char>('a' + t));
                });
                const std::string text = contents(path("t"));
                EXPECT_EQ(text, std::string(10000, text.at(0)));
            }
        });
    }
    writers.clear();
    EXPECT_EQ(files(), 1u);
}

TEST(TableValidate, RefusesWhatIsNoTable) {
    const Table good = product_table(1, {"y"});
    EXPECT_NO_THROW(validate(good));
    auto refused = [&](auto&& spoil) {
        Table bad = good;
        spoil(bad);
        EXPECT_THROW(validate(bad), Error);
    };
    refused([](Table& t) { t.f.pop_back(); });
    refused([](Table& t) { t.se.push_back(0); });
    refused([](Table& t) { t.bias.clear(); });
    refused([](Table& t) { t.f[3] = std::numeric_limits<float>::quiet_NaN(); });
    refused([](Table& t) { t.se[3] = std::numeric_limits<float>::infinity(); });
    refused([](Table& t) { t.incident.clear(); });
    refused([](Table& t) { t.outgoing[0].phi_deg = std::numeric_limits<double>::quiet_NaN(); });
    refused([](Table& t) { t.channels[0] = "a,b"; });
    refused([](Table& t) { t.channels.clear(); });
    refused([](Table& t) { t.orders = -1; });
    refused([](Table& t) { t.cells = equal_cells(static_cast<int>(t.outgoing.size()) + 1); });
    refused([](Table& t) {
        t.cells = equal_cells(static_cast<int>(t.outgoing.size()));
        t.cells[0].theta_max_deg = t.cells[0].theta_min_deg;
    });
    refused([](Table& t) { t.pairs.assign(t.rows(), {0, 99}); });
}

TEST(TableParse, MalformedTextIsRefused) {
    const std::string header = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg";
    const std::string y = header + ",f_y,se_y,bias_y\n", orders = header + ",order,f_y,se_y,bias_y\n";
    const std::string bad[] = {"",
                               "\n",
                               "hello",
                               "#",
                               "# gonio table, version 2\n" + y + "0,0,0,0,1,1,1\n",
                               header,
                               header + "\n",
                               y,
                               header + ",f_y,se_z,bias_y\n0,0,0,0,1,1,1\n",
                               header + ",f_y,se_y\n0,0,0,0,1,1\n",
                               y + "0,0,0,0,1,1\n",
                               y + "0,0,0,0,1,1,\n",
                               y + "0,0,0,0,1,1,1,1\n",
                               y + "0,0,0,0,1,nan,1\n",
                               y + "0,0,0,0,1,inf,1\n",
                               y + "0,0,0,0,1e99,1,1\n",
                               y + "0,0,0,x,1,1,1\n",
                               y + "0,,0,0,1,1,1\n",
                               y + "0;0;0;0;1;1;1\n",
                               orders + "0,0,0,0,1,1,1,1\n",
                               orders + "0,0,0,0,0,1,1,1\n0,0,0,0,2,1,1,1\n",
                               orders + "0,0,0,0,0,1,1,1\n0,0,0,0,1,1,1,1\n0,0,5,0,0,1,1,1\n",
                               orders + "0,0,0,0,0,1,1,1\n0,0,5,0,1,1,1,1\n",
                               "{",
                               "{}",
                               "[]",
                               R"({"format":"gonio-table","version":2})",
                               R"({"format":"gonio-table","version":1})",
                               R"({"format":"other","version":1})",
                               std::string(100000, '['),
                               "{\"a\":" + std::string(100000, '[')};
    for (const std::string& text : bad) EXPECT_THROW(parse_table(text, "bad"), Error) << text.substr(0, 200);
}

TEST(TableParse, EveryTruncationAndEveryBrokenByteIsHandled) {
    for (auto* write : {&write_csv, &write_json}) {
        std::ostringstream out;
        write(product_table(1, {"y"}), out);
        const std::string text = out.str();
        for (size_t length = 0; length < text.size(); length += 7) {
            try {
                validate(parse_table(std::string_view(text).substr(0, length), "cut"));
            } catch (const Error&) {
            }
        }
        for (uint64_t k = 0; k < 2000; ++k) {
            std::string broken = text;
            const auto words = random_words(1, 2, k);
            broken[words[0] % broken.size()] = static_cast<char>(words[1]);
            try {
                validate(parse_table(broken, "broken"));
            } catch (const Error&) {
            }
        }
    }
}

}  // namespace
}  // namespace gonio
