// Figures: every kind of table gives one; what is drawn is what the table holds.
#include "clients/plot/plot.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "clients/plot/axis.h"
#include "clients/plot/palette.h"
#include "clients/plot/table_view.h"
#include "directions/gonio_grid.h"
#include "surface/generate.h"

namespace gonio {
namespace {

namespace fs = std::filesystem;

Table table_of(std::vector<AnglesDeg> incident, std::vector<AnglesDeg> outgoing,
               std::vector<std::string> channels) {
    Table table;
    table.incident = std::move(incident);
    table.outgoing = std::move(outgoing);
    table.channels = std::move(channels);
    const size_t n = table.channels.size() * table.rows();
    for (size_t k = 0; k < n; ++k) table.f.push_back(0.1f + 0.01f * static_cast<float>(k % 7));
    table.se.assign(n, 0.003f);
    table.bias.assign(n, 0.004f);
    return table;
}

// cairo prints coordinates with %f; images inside are base64, which has neither blanks nor signs before
// letters.
bool has_only_finite_numbers(const std::string& svg) {
    for (const std::string sign : {" ", "-", "\"", ","})
        for (const std::string word : {"nan", "inf"})
            if (svg.find(sign + word) != std::string::npos) return false;
    return true;
}

class Figures : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("gonio-plot-" + std::to_string(::getpid()));
        fs::create_directories(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    std::string contents(const std::string& name) const {
        std::ifstream in(path(name), std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    fs::path folder_;
};

TEST_F(Figures, EveryShapeOfTableIsDrawn) {
    const std::vector<AnglesDeg> grid =
        product_grid({0, 20, 40, 60, 80}, {0, 45, 90, 135, 180, 225, 270, 315});
    Table pairs = table_of({{30, 0}, {50, 0}}, grid, {"y"});
    pairs.pairs = {{0, 3}, {1, 2}, {0, 8}};
    pairs.f.resize(3), pairs.se.resize(3), pairs.bias.resize(3);
    Table zero = table_of({{30, 0}}, grid, {"y"});
    zero.f.assign(zero.f.size(), 0), zero.se = zero.bias = zero.f;
    Table constant = table_of({{30, 0}}, grid, {"y"});
    constant.f.assign(constant.f.size(), 0.25f);
    const Table tables[] = {
        table_of({{0, 0}, {30, 0}, {60, 0}, {60, 90}}, grid, {"y"}),
        table_of({{45, 20}}, grid, {"r", "g", "b"}),
        table_of({{45, 0}}, {{45, 180}}, {"y"}),
        table_of(equal_projected_hemisphere(32), equal_projected_hemisphere(32), {"450nm", "550nm"}),
        table_of(klems_full(), klems_full(), {"y"}),
        pairs,
        zero,
        constant};
    for (const Table& table : tables) {
        for (const bool log_scale : {false, true}) {
            PlotOptions options;
            options.log_scale = log_scale;
            plot_table(table, path("t.png"), options);
            plot_table(table, path("t.svg"), options);
            EXPECT_EQ(contents("t.png").substr(1, 3), "PNG");
            const std::string svg = contents("t.svg");
            EXPECT_NE(svg.find("</svg>"), std::string::npos);
            EXPECT_TRUE(has_only_finite_numbers(svg));
        }
    }
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 2);
}

TEST_F(Figures, BadRequestsAreRefused) {
    const Table table = table_of({{45, 0}}, {{45, 180}}, {"y"});
    EXPECT_THROW(plot_table(table, path("t.pdf")), Error);
    EXPECT_THROW(plot_table(table, path("no/such/t.png")), Error);
    EXPECT_THROW(plot_table(table, path("no/such/t.svg")), Error);
    EXPECT_THROW(plot_table({}, path("t.png")), Error);
    EXPECT_THROW(plot_table(table, path("t.png"), {"", 1, "", false}), Error);
    EXPECT_THROW(plot_table(table, path("t.png"), {"", -1, "r", false}), Error);
    EXPECT_THROW(plot_lines({}, path("t.png"), {}), Error);
    EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Figures, NdfsAndChartsAreDrawn) {
    const HeightField surfaces[] = {generate_gaussian(64, 64, 1e-6, 4e-6, 0.4, 1), generate_plane(4, 1e-6),
                                    generate_v_groove(32, 1e-3, 45)};
    for (const HeightField& s : surfaces) {
        plot_ndf(measure_ndf(s), path("n.svg"));
        EXPECT_TRUE(has_only_finite_numbers(contents("n.svg")));
    }
    plot_lines({{"a", {1, 10, 100}, {0, 1, -1}}, {"b", {1, 1000}, {1e-5, 1e3}, true}}, path("l.svg"),
               {"title", "x", "y", "", true, true});
    EXPECT_TRUE(has_only_finite_numbers(contents("l.svg")));
    plot_lines({{"a", {1}, {1}}}, path("l.png"), {"title", "x", "y", "", false, false});
    EXPECT_EQ(contents("l.png").substr(1, 3), "PNG");
}

TEST(TableView, ThePlaneOfIncidenceIsSigned) {
    Table table =
        table_of({{30, 40}}, {{0, 0}, {0, 90}, {20, 40}, {20, 220}, {60, -140}, {60, 41}, {70, 400}}, {"y"});
    for (size_t k = 0; k < table.f.size(); ++k) table.f[k] = static_cast<float>(k);
    const auto lobe = in_plane(samples_of(table, 0, 0), table.incident[0]);
    ASSERT_EQ(lobe.size(), 5u);
    const double theta_deg[] = {-70, -20, 0, 20, 60}, f[] = {6, 2, 0, 3, 4};
    for (int k = 0; k < 5; ++k) {
        EXPECT_EQ(lobe[k].theta_deg, theta_deg[k]);
        EXPECT_EQ(lobe[k].f, f[k]);
        EXPECT_NEAR(lobe[k].error, 0.005, 1e-8);
    }
}

TEST(Axis, TicksAndLabels) {
    EXPECT_EQ(ticks({0, 1, false}, 5), (std::vector<double>{0, 0.2, 0.4, 3 * 0.2, 0.8, 1}));
    EXPECT_EQ(ticks({0.1, 100, true}, 4), (std::vector<double>{0.1, 1, 10, 100}));
    EXPECT_EQ(tick_label(0.25), "0.25");
    EXPECT_EQ(tick_label(1e-5), "10\u207b\u2075");
    EXPECT_EQ(tick_label(3e7), "3\u00b710\u2077");
    EXPECT_NEAR(Scale({1, 100, true}).place(10), 0.5, 1e-12);
    EXPECT_LT(enclosing_scale(5, 5, false).low, 5);
    EXPECT_GT(enclosing_scale(5, 5, false).high, 5);
}

TEST(Palette, ViridisRisesInLightness) {
    double last = -1;
    for (int k = 0; k <= 20; ++k) {
        const Colour c = viridis(k / 20.0);
        const double luminance = 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b;
        EXPECT_GT(luminance, last);
        last = luminance;
    }
}

}  // namespace
}  // namespace gonio
