// Honest errors: the true error lies within 1, 2 and 3 times sqrt(se^2 + bias^2) as often as a normal deviate
// would, within 5 points, over thousands of table entries. Truth: closed forms and the reference answers of
// ../validation for V-grooves, which their grids are exactly, and data/honest_*.json
// (make_honest_references.cpp) for other reliefs.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>

#include "agreement/honest_surfaces.h"
#include "agreement/measured.h"
#include "validation/closed_forms.h"
#include "validation/reference_data.h"

namespace gonio {
namespace {

constexpr int n_seeds = 8;

// Counts entries whose error is within k stated errors; the parts are shown when a bar is missed, for too
// wide and too narrow have different cures.
struct Coverage {
    long long entries = 0;
    std::array<long long, 3> within{};
    double error = 0, se = 0, bias = 0;  // sums of squares, relative to the true value

    // least: what a small value's errors are told relative to.
    void add(double truth, double f, double se_of_f, double bias_of_f, double least = 0) {
        const double off = std::abs(f - truth), sigma = std::hypot(se_of_f, bias_of_f);
        // No facet lights another, or the grid resolves all: exact but for rounding to float.
        if (off <= 2e-6 * std::max(1.0, truth)) return;
        ++entries;
        for (int k = 0; k < 3; ++k) within[k] += off <= (k + 1) * sigma;
        const double scale = std::max(truth, least);
        error += std::pow(off / scale, 2);
        se += std::pow(se_of_f / scale, 2);
        bias += std::pow(bias_of_f / scale, 2);
    }
    void add(const Coverage& other) {
        entries += other.entries;
        for (int k = 0; k < 3; ++k) within[k] += other.within[k];
        error += other.error;
        se += other.se;
        bias += other.bias;
    }
    double percent(int k) const {
        return 100.0 * static_cast<double>(within[k]) / static_cast<double>(entries);
    }
    double rms(double sum) const { return std::sqrt(sum / static_cast<double>(entries)); }
    std::string text() const {
        char line[160];
        std::snprintf(
            line, sizeof line,
            "%6lld entries: %5.1f %5.1f %5.1f %% within 1, 2, 3 sigma; rms error %.1e, se %.1e, bias %.1e",
            entries, percent(0), percent(1), percent(2), rms(error), rms(se), rms(bias));
        return line;
    }
};

nlohmann::json truth_of(const std::string& relief, const std::string& facets = "lambertian",
                        honest::Receivers receivers = honest::Receivers::directions) {
    return reference::load_json("../../agreement/data/" + honest::truth_file(relief, facets, receivers));
}

double error_of(const nlohmann::json& truth) {
    return std::hypot(truth.at("rms_relative_se").get<double>(), truth.at("rms_relative_bias").get<double>());
}

Coverage table_of(const honest::Relief& relief, double target, const std::string& facets = "lambertian",
                  int seeds = n_seeds, const BrdfPlan& wanted = honest::plan()) {
    const HeightField surface = relief.make();
    const nlohmann::json truth =
        truth_of(relief.name, facets,
                 wanted.outgoing_cells.empty() ? honest::Receivers::directions : honest::Receivers::cells);
    EXPECT_EQ(truth.at("surface_hash"), surface_hash(surface));
    const std::vector<double> values = truth.at("f");
    const double mean =
        std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    Coverage coverage;
    for (int seed = 1; seed <= seeds; ++seed) {
        BrdfPlan plan = wanted;
        plan.accuracy.target_relative_error = target;
        plan.accuracy.seed = seed;
        const Table table = measure(surface, honest::material(facets), plan).table;
        for (size_t k = 0; k < values.size(); ++k)
            coverage.add(values[k], table.f[k], table.se[k], table.bias[k], 0.01 * mean);
    }
    // A truth three times better than what it judges adds 5 % to the errors.
    EXPECT_LT(3 * error_of(truth), coverage.rms(coverage.error)) << relief.name << " " << facets;
    return coverage;
}

// All orders, every albedo of the reference answers.
Coverage v_groove(const std::string& name, double target) {
    const reference::Case expected = reference::load_case(name);
    const HeightField surface = reference::surface(expected, 64);
    Coverage coverage;
    for (int seed = 1; seed <= n_seeds; ++seed) {
        BrdfPlan plan = expected.plan();
        plan.accuracy.target_relative_error = target;
        plan.accuracy.seed = seed;
        const Table table = measure(surface, expected.material(false), plan).table;
        size_t channel = 0;
        for (const reference::Quantity& quantity : expected.quantities) {
            if (quantity.order != 0) continue;
            for (size_t row = 0; row < table.rows(); ++row) {
                const size_t k = table.index(channel, 0, row);
                coverage.add(quantity.values[row], table.f[k], table.se[k], table.bias[k]);
            }
            ++channel;
        }
    }
    return coverage;
}

// Direct light, by its closed form.
Coverage v_groove_direct(double alpha_deg, double target) {
    const HeightField surface = generate_v_groove(64, 2, alpha_deg);
    const double slope = std::tan(radians(alpha_deg));
    Coverage coverage;
    for (int seed = 1; seed <= n_seeds; ++seed) {
        BrdfPlan plan = honest::plan();
        plan.max_order = 1;
        plan.accuracy.target_relative_error = target;
        plan.accuracy.seed = seed;
        const Table table = measure(surface, honest::material(), plan).table;
        for (size_t k = 0; k < table.f.size(); ++k) {
            const auto [i, o] = table.pair(k);
            coverage.add(
                reference::v_groove_direct(slope, honest::albedo, plan.incident[i], plan.outgoing[o]),
                table.f[k], table.se[k], table.bias[k]);
        }
    }
    return coverage;
}

class HonestErrors : public testing::TestWithParam<double> {};

void expect_honest(const std::vector<std::pair<std::string, Coverage>>& parts, double target) {
    Coverage all;
    std::string text;
    for (const auto& [name, coverage] : parts) {
        all.add(coverage);
        text += "\n  " + name + ": " + coverage.text();
    }
    EXPECT_GT(all.entries, 4000);
    const double normal[] = {68.3, 95.4, 99.7};
    for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(all.percent(k), normal[k], 5)
            << "within " << k + 1 << " sigma, target " << target << text;
    std::printf("target %g: %s%s\n", target, all.text().c_str(), text.c_str());
}

TEST_P(HonestErrors, CoverTheTruthAsOftenAsTheyShould) {
    std::vector<std::pair<std::string, Coverage>> parts;
    for (const honest::Relief& relief : honest::reliefs)
        if (relief.seen_before) parts.emplace_back(relief.name, table_of(relief, GetParam()));
    for (const char* name : {"vgroove_a20", "vgroove_a45", "vgroove_a70"})
        parts.emplace_back(name, v_groove(name, GetParam()));
    for (const double alpha_deg : {33.0, 60.0})
        parts.emplace_back("direct light of a groove", v_groove_direct(alpha_deg, GetParam()));
    expect_honest(parts, GetParam());
}

// No constant of the engine was measured on these.
TEST_P(HonestErrors, CoverTheTruthOfReliefsNeverSeenBefore) {
    std::vector<std::pair<std::string, Coverage>> parts;
    for (const honest::Relief& relief : honest::reliefs)
        if (!relief.seen_before) parts.emplace_back(relief.name, table_of(relief, GetParam()));
    expect_honest(parts, GetParam());
}

// Where the truth is good enough to judge the target.
TEST_P(HonestErrors, CoverTheTruthOfGlossyFacets) {
    std::vector<std::pair<std::string, Coverage>> parts;
    for (const auto& [relief, facets] : honest::glossy)
        if (4 * error_of(truth_of(relief, facets)) < GetParam())
            parts.emplace_back(std::string(relief) + " " + facets,
                               table_of(honest::relief(relief), GetParam(), facets, 4));
    expect_honest(parts, GetParam());
}

// Means over cells: by looking from places inside (measure/cell_views.h), and by counting what arrives.
TEST(HonestCells, CoverTheTruth) {
    constexpr double target = 0.02;
    for (const bool forward : {false, true}) {
        std::vector<std::pair<std::string, Coverage>> parts;
        for (const auto& [relief, facets] : honest::in_cells) {
            BrdfPlan plan = honest::cell_plan();
            plan.transport = forward                               ? TransportKind::forward
                             : facets == std::string("lambertian") ? TransportKind::diffuse
                                                                   : TransportKind::pair_graph;
            parts.emplace_back(std::string(relief) + " " + facets + (forward ? ", forward" : ""),
                               table_of(honest::relief(relief), target, facets, 6, plan));
        }
        expect_honest(parts, target);
    }
}

INSTANTIATE_TEST_SUITE_P(Targets, HonestErrors, testing::Values(0.01, 0.002));

// The truth itself, judged by the path tracer when it was made: no more than its own noise apart, and no
// shift of the whole table.
TEST(HonestTruth, AgreesWithThePathTracer) {
    std::vector<nlohmann::json> truths;
    for (const honest::Relief& relief : honest::reliefs) truths.push_back(truth_of(relief.name));
    for (const auto& [relief, facets] : honest::glossy) truths.push_back(truth_of(relief, facets));
    for (const auto& [relief, facets] : honest::in_cells)
        truths.push_back(truth_of(relief, facets, honest::Receivers::cells));
    for (const nlohmann::json& truth : truths) {
        SCOPED_TRACE(truth.at("command").get<std::string>());
        const nlohmann::json& traced = truth.at("path_tracer");
        EXPECT_LT(traced.at("rms_relative_se"), truth.contains("facets") ? 0.01 : 0.003);
        EXPECT_LT(traced.at("rms_pull"), 1.3);
        EXPECT_LT(std::abs(traced.at("mean_relative_difference").get<double>()),
                  3 * traced.at("se_of_mean").get<double>());
    }
}

}  // namespace
}  // namespace gonio
