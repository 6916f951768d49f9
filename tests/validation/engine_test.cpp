// The fast engine against closed forms and reference answers: every Lambertian case, within the tolerances
// that the answers come with and the errors that the engine states.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "directions/gonio_grid.h"
#include "measure/brdf.h"
#include "surface/statistics.h"
#include "validation/reference_data.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

using reference::Case;
using reference::Quantity;

// What the grid does to a relief that it only approximates, relative to the BRDF; `grazing` from 75 degrees.
struct Tolerance {
    double usual = 0, grazing = 0;
};

Material gray(double albedo) {
    Lambertian lambertian;
    lambertian.albedo = {albedo};
    return {{"y"}, lambertian};
}

BrdfResult measure(const HeightField& surface, const Material& material, BrdfPlan plan,
                   const Accuracy::Samples& samples) {
    plan.accuracy.samples = samples;
    return measure_brdf(surface, material, plan, {});
}

// Values that lie further from the truth than the grid's share and the stated errors allow. largest_sigma:
// the errors themselves must be small, relative to the BRDF.
class Comparison {
  public:
    Comparison(std::string what, Tolerance tolerance, double largest_sigma)
        : what_(std::move(what)), tolerance_(tolerance), largest_sigma_(largest_sigma) {}

    void add(const std::string& label, double found, double expected, double sigma, double brdf,
             bool grazing) {
        const double allowed = brdf * (grazing ? tolerance_.grazing : tolerance_.usual) +
                               3e-6 * std::max(1.0, expected);  // float
        entries_.push_back({label, found, expected, allowed, sigma, std::max(brdf, 0.1)});
    }
    void add(const Case& reference, const Quantity& quantity, const Table& table, size_t channel) {
        for (size_t row = 0; row < table.rows(); ++row) {
            const auto [i, o] = reference.pairs[row];
            const AnglesDeg wi = reference.incident[i], wo = reference.outgoing[o];
            double brdf = 0;  // of the pair: an order that is 0 in the limit need not be so on the grid
            for (const Quantity& other : reference.quantities) brdf = std::max(brdf, other.values[row]);
            const size_t k = table.index(channel, quantity.order, row);
            const double uncertainty = quantity.uncertainties[row] / 2;
            add(quantity.key + " row " + std::to_string(row), table.f[k], quantity.values[row],
                std::hypot(table.se[k], table.bias[k], uncertainty), brdf,
                std::max(wi.theta_deg, wo.theta_deg) >= 75);
        }
    }
    // 3 sigma, or what one in a hundred tests of this size exceeds.
    ~Comparison() {
        const double sigmas = std::max(3.0, reference::sidak_sigmas(entries_.size()));
        double squares = 0;
        for (const Entry& e : entries_) {
            EXPECT_LT(std::abs(e.found - e.expected), e.allowed + sigmas * e.sigma)
                << what_ << ", " << e.label << ": " << e.found << " for " << e.expected << ", sigma "
                << e.sigma;
            squares += std::pow(e.sigma / e.brdf, 2) / static_cast<double>(entries_.size());
        }
        EXPECT_LE(std::sqrt(squares), largest_sigma_) << what_;
    }

  private:
    struct Entry {
        std::string label;
        double found, expected, allowed, sigma, brdf;
    };
    std::string what_;
    Tolerance tolerance_;
    double largest_sigma_;
    std::vector<Entry> entries_;
};

// All quantities of a case in one measurement: totals of all albedos, single orders at albedo 1.
void compare(const Case& expected, const HeightField& surface, const Accuracy::Samples& samples,
             Tolerance tolerance, double largest_sigma = 0.003) {
    Material material = expected.material(false);
    auto& albedos = std::get<Lambertian>(material.lobes.front().lobe).albedo.constant;
    const size_t white = albedos.size();
    albedos.push_back(1);
    material.channels.emplace_back("single orders");
    BrdfPlan plan = expected.plan();
    plan.separate_orders = true;
    const Table table = measure(surface, material, plan, samples).table;
    Comparison comparison(expected.name, tolerance, largest_sigma);
    size_t channel = 0;
    for (const Quantity& quantity : expected.quantities)
        comparison.add(expected, quantity, table, quantity.order ? white : channel++);
}

// Directional albedos: the mean of pi f over views of equal projected solid angle. Within 3 sigma with sigma
// <= 0.3 % (README of the reference answers): the views alone err by that much where f peaks between grazing
// directions.
void compare_albedos(const Case& expected, const HeightField& surface, const Accuracy::Samples& samples,
                     int n_views = 2048, double grid = 0) {
    if (!expected.document.contains("albedo_entries")) return;
    std::vector<double> albedos;
    BrdfPlan plan;
    Material material;
    const auto index_of = [](auto& list, const auto& value) {
        const auto found = std::find(list.begin(), list.end(), value);
        if (found != list.end()) return static_cast<size_t>(found - list.begin());
        list.push_back(value);
        return list.size() - 1;
    };
    struct Wanted {
        size_t light, channel;
        double value;
    };
    std::vector<Wanted> wanted;
    for (const auto& entry : expected.document.at("albedo_entries")) {
        const AnglesDeg wi = entry.at("wi").is_array() ? AnglesDeg{entry.at("wi").at(0), entry.at("wi").at(1)}
                                                       : AnglesDeg{40, 25};  // "any"
        wanted.push_back({index_of(plan.incident, wi), index_of(albedos, entry.at("rho").get<double>()),
                          entry.at("value")});
    }
    for (const double albedo : albedos) material.channels.push_back(std::to_string(albedo));
    material.lobes = {{1.0, Lambertian{albedos}}};
    plan.outgoing = equal_projected_hemisphere(n_views);
    const Table table = measure(surface, material, plan, samples).table;
    const size_t n = plan.outgoing.size();
    for (const Wanted& w : wanted) {
        double albedo = 0;
        for (size_t o = 0; o < n; ++o)
            albedo += pi / static_cast<double>(n) * table.f[table.index(w.channel, 0, w.light * n + o)];
        EXPECT_NEAR(albedo, w.value, (0.009 + grid) * w.value)
            << expected.name << ", light " << w.light << ", albedo " << material.channels[w.channel];
    }
}

TEST(FastEngine, PlanesAreExact) {
    int n = 0;
    for (const char* name : {"flat_plane", "flat_plane_b"}) {
        const nlohmann::json document = reference::load_json(name);
        for (const auto& entry : document.at("entries")) {
            if (entry.at("micro").at("type") != "lambertian") continue;
            BrdfPlan plan;
            plan.incident = {{entry.at("wi").at(0), entry.at("wi").at(1)}};
            plan.outgoing = {{entry.at("wo").at(0), entry.at("wo").at(1)}};
            for (const bool skips : {true, false}) {
                RunOptions options;
                options.allow_skips = skips;
                const Table table =
                    measure_brdf(generate_plane(4, 1e-3), gray(entry.at("micro").at("rho")), plan, options)
                        .table;
                EXPECT_NEAR(table.f[0], entry.at("value").get<double>(), 1e-7);
                EXPECT_LT(table.se[0] + table.bias[0], 1e-6);
            }
            ++n;
        }
    }
    EXPECT_GT(n, 20);
}

// Facets on nodes: the grid is the relief. The direct term within 1e-4, all orders within the stated error.
TEST(FastEngine, VGrooves) {
    for (const char* name : {"vgroove_a20", "vgroove_a33", "vgroove_a45", "vgroove_a70"}) {
        const Case expected = reference::load_case(name);
        const HeightField surface = reference::surface(expected, 128);
        compare(expected, surface, {64, 512, 1, 8}, {});
        compare_albedos(expected, reference::surface(expected, 64), {8, 256, 1, 4});

        BrdfPlan plan = expected.plan();
        plan.max_order = 1;
        const Table direct = measure(surface, gray(1), plan, {1024, 16, 1, 4}).table;
        for (const Quantity& quantity : expected.quantities) {
            if (quantity.order != 1) continue;
            for (size_t row = 0; row < direct.rows(); ++row)
                EXPECT_NEAR(direct.f[row], quantity.values[row], 1e-4 * quantity.values[row] + 1e-6)
                    << name << " direct, row " << row;
        }
    }
}

TEST(FastEngine, RectangularGrooves) {
    for (const char* name : {"rectgroove_a1_d1_b1", "rectgroove_a1_d0p5_b0p25"}) {
        const Case expected = reference::load_case(name);
        // One row of facets averages little: the operator needs many directions, and they are cheap here.
        const HeightField surface = reference::surface(expected, 640);
        const double leaning_walls = 1.5 * surface.pitch_x;
        compare(expected, surface, {64, 4096, 2, 8}, {leaning_walls, leaning_walls});
        const HeightField coarser = reference::surface(expected, 160);
        compare_albedos(expected, coarser, {32, 8192, 4, 4}, 256, 1.5 * coarser.pitch_x);
    }
}

TEST(FastEngine, Sinusoids) {
    for (const char* name : {"sine_A0p08", "sine_A0p15", "sine_A0p3"}) {
        const Case expected = reference::load_case(name);
        compare(expected, reference::surface(expected, 256), {16, 512, 1, 4}, {0.003, 0.003});
    }
}

TEST(FastEngine, EggCrate) {
    const Case expected = reference::load_case("eggcrate_A0p1");
    compare(expected, reference::surface(expected, 128), {1, 128, 1, 4}, {0.003, 0.003});
}

// The rim is an edge off the nodes; what the grid takes from the light between grazing directions there is
// measured in agreement/path_tracer_test.cpp.
TEST(FastEngine, SphericalPits) {
    const struct {
        const char* name;
        int n;
        Tolerance tolerance;
        Accuracy::Samples samples;
        double largest_sigma;
    } cases[] = {{"pits_eta45_cov0p7", 288, {0.0015, 0.0075}, {1, 64, 1, 4}, 0.003},
                 {"pits_eta60_cov0p6", 288, {0.0015, 0.0075}, {1, 64, 1, 4}, 0.003},
                 {"pits_hemisphere_cov0p5", 192, {0.02, 0.04}, {1, 256, 2, 4}, 0.003}};  // one-facet walls
    for (const auto& [name, n, tolerance, samples, largest_sigma] : cases) {
        const Case expected = reference::load_case(name);
        compare(expected, reference::surface(expected, n), samples, tolerance, largest_sigma);
        compare_albedos(expected, reference::surface(expected, 64), {1, 64, 1, 2});
    }
}

// Ensembles: 16 fields of 32 correlation lengths, each turned by quarters, its slope rescaled.
constexpr int n_fields = 16;

struct EnsemblePair {
    AnglesDeg wi, wo;
    std::vector<double> mean, squares;  // per slice, over the fields
};

// Every other node, heights scaled back to the rms slope of the whole.
HeightField coarsened(const HeightField& fine) {
    const int nx = fine.nx / 2, ny = fine.ny / 2;
    std::vector<double> heights;
    for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i) heights.push_back(fine.at(2 * i, 2 * j));
    const auto rms_slope = [](const HeightField& s) {
        const SurfaceStatistics statistics = surface_statistics(s);
        return std::hypot(statistics.rms_slope_x, statistics.rms_slope_y);
    };
    const double scale =
        rms_slope(fine) / rms_slope(make_height_field(nx, ny, 2 * fine.pitch_x, 2 * fine.pitch_y, heights));
    for (double& h : heights) h *= scale;
    return make_height_field(nx, ny, 2 * fine.pitch_x, 2 * fine.pitch_y, heights);
}

// Mean over fields and quarter turns of f at albedo 1, slice by slice. to_the_limit: between grazing
// directions a grid lets too little light through, in proportion to its pitch (from 85 to 85 degrees 8 % with
// 8 cells a correlation length, 4 % with 16), so the same field with every other node is measured as well,
// and the line through both followed to pitch 0.
void measure_ensemble(double rms_slope, int cells_per_length, bool to_the_limit, int max_order,
                      const Accuracy::Samples& samples, std::vector<EnsemblePair>& pairs) {
    BrdfPlan plan;
    for (const EnsemblePair& pair : pairs)
        for (const double turn : {0, 90, 180, 270}) {
            const auto index_of = [&](std::vector<AnglesDeg>& list, AnglesDeg angles) {
                angles.phi_deg = std::fmod(angles.phi_deg + turn, 360.0);
                if (angles.theta_deg == 0) angles.phi_deg = 0;
                const auto found = std::find(list.begin(), list.end(), angles);
                if (found != list.end()) return static_cast<int>(found - list.begin());
                list.push_back(angles);
                return static_cast<int>(list.size()) - 1;
            };
            const int i = index_of(plan.incident, pair.wi), o = index_of(plan.outgoing, pair.wo);
            plan.pairs.emplace_back(i, o);
        }
    plan.max_order = max_order;
    plan.separate_orders = max_order != 1;
    const int n = 32 * cells_per_length;
    for (int field = 0; field < n_fields; ++field) {
        const HeightField surface = generate_gaussian(n, n, 1, cells_per_length, rms_slope, 100 + field);
        const Table table = measure(surface, gray(1), plan, samples).table;
        const Table coarse = to_the_limit ? measure(coarsened(surface), gray(1), plan, samples).table : table;
        for (size_t p = 0; p < pairs.size(); ++p) {
            const size_t slices = std::min<size_t>(3, table.slices());
            pairs[p].mean.resize(slices);
            pairs[p].squares.resize(slices);
            for (size_t slice = 0; slice < slices; ++slice) {
                double f = 0;
                for (size_t turn = 0; turn < 4; ++turn) {
                    const size_t k = table.index(0, slice, 4 * p + turn);
                    f += (2 * table.f[k] - coarse.f[k]) / 4;
                }
                pairs[p].mean[slice] += f / n_fields;
                pairs[p].squares[slice] += f * f / n_fields;
            }
        }
    }
}

AnglesDeg angles(const nlohmann::json& list) {
    return {list.at(0), list.at(1)};
}

TEST(FastEngine, GaussianDirectTerms) {
    for (const char* name :
         {"gaussian_alpha0p2", "gaussian_alpha0p35", "gaussian_alpha0p5", "gaussian_alpha1p0"}) {
        const nlohmann::json document = reference::load_json(name);
        std::vector<EnsemblePair> pairs;
        std::vector<double> expected, uncertainty;
        for (const auto& entry : document.at("entries")) {
            pairs.push_back({angles(entry.at("wi")), angles(entry.at("wo")), {}, {}});
            expected.push_back(entry.at("value"));
            uncertainty.push_back(entry.at("uncertainty"));
        }
        for (const auto& entry : document.at("out_of_plane_entries")) {
            pairs.push_back({angles(entry.at("wi")), angles(entry.at("wo")), {}, {}});
            expected.push_back(entry.at("lambert_direct_rho1"));
            uncertainty.push_back(entry.at("lambert_uncertainty"));
        }
        measure_ensemble(document.at("surface").at("alpha"), 16, true, 1, {1, 16, 1, 2}, pairs);
        for (size_t p = 0; p < pairs.size(); ++p) {
            const double sigma = std::sqrt(
                std::max(0.0, pairs[p].squares[0] - pairs[p].mean[0] * pairs[p].mean[0]) / (n_fields - 1));
            EXPECT_NEAR(pairs[p].mean[0], expected[p], 0.01 * expected[p] + uncertainty[p])
                << name << ", " << pairs[p].wi.theta_deg << " " << pairs[p].wi.phi_deg << " -> "
                << pairs[p].wo.theta_deg << " " << pairs[p].wo.phi_deg << ", sigma " << sigma;
        }
    }
}

TEST(FastEngine, GaussianMultipleScattering) {
    for (const char* name : {"gaussian_alpha0p5_multibounce", "gaussian_alpha1p0_multibounce"}) {
        const nlohmann::json document = reference::load_json(name);
        std::vector<EnsemblePair> pairs;
        for (const auto& entry : document.at("lambert_entries"))
            pairs.push_back({angles(entry.at("wi")), angles(entry.at("wo")), {}, {}});
        // What is beyond the 8th order is less than 1e-3 of the whole at either slope.
        measure_ensemble(document.at("surface").at("alpha"), 8, false, 8, {1, 32, 1, 2}, pairs);
        for (size_t p = 0; p < pairs.size(); ++p) {
            const auto& entry = document.at("lambert_entries").at(p);
            const double total = entry.at("total_rho1"),
                         tolerance = 0.01 * total + entry.at("uncertainty").get<double>();
            EXPECT_NEAR(pairs[p].mean[0], total, tolerance) << name << " total, pair " << p;
            EXPECT_NEAR(pairs[p].mean[1], entry.at("direct_rho1").get<double>(), tolerance)
                << name << " direct, pair " << p;
            EXPECT_NEAR(pairs[p].mean[2], entry.at("second_order_rho1").get<double>(), tolerance)
                << name << " second order, pair " << p;
        }
    }
}

}  // namespace
}  // namespace gonio
