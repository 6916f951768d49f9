// Horizons of the lockstep march against the reference tables: closed forms and root finding, 1e-9 or better.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "validation/reference_data.h"
#include "visibility/march.h"

namespace gonio {
namespace {

// Where a relief is convex, a point's horizon is its own tangent, and that of a facet is the relief's to
// O(pitch) only: smooth reliefs get the finer grid.
constexpr int samples = 512, smooth_samples = 2048;

// A relief of the tables and where its grid lies: table coordinates start `origin` metres from node (0, 0).
struct Relief {
    HeightField surface;
    MarchGrid grid;
    double origin = 0;
    bool exact = false, rims = false;  // it is its own mesh; it has edges off the nodes
};

Relief make_relief(const std::string& name) {
    const auto number = [&](const std::string& key) {
        return std::stod(name.substr(name.find(key) + key.size()));
    };
    Relief relief;
    if (name.starts_with("vgroove")) {
        relief.surface = generate_v_groove(samples, 2, number("alpha="));
        relief.exact = true;
    } else if (name.starts_with("rect")) {
        const double period = number("a=") + number(" b=");
        relief.surface = generate_rectangular_groove(samples * 5 / 4, period, number("a="), number("d="));
        relief.origin = -0.5 * relief.surface.pitch_x;
        relief.rims = true;
    } else if (name.starts_with("spherical pits")) {
        const double eta_deg = number("eta="), rim = std::sin(radians(eta_deg));
        const double period = rim * std::sqrt(pi / number("cover="));
        relief.surface = generate_spherical_pits(samples, period, 1, eta_deg);
        relief.origin = period / 2 - 0.5 * relief.surface.pitch_x;
        relief.rims = true;
    } else if (name.starts_with("eggcrate")) {
        relief.surface = generate_egg_crate(smooth_samples, 1, number("A="));
    } else {
        throw std::runtime_error("unknown surface " + name);
    }
    relief.grid = make_march_grid(relief.surface);
    return relief;
}

struct Horizon {
    double slope = 0;
    double depth = 0;  // of the point below the highest node
};

// The march starts inside facets: a point on an edge is moved inwards by 1e-4 cell.
Horizon march(const Relief& relief, double x, double y, double phi_deg) {
    const HeightField& s = relief.surface;
    const auto place = [](double coordinate, int n) {
        const double cells = coordinate - n * std::floor(coordinate / n);
        const int cell = std::min(n - 1, static_cast<int>(cells));
        return std::pair{cell, std::clamp(cells - cell, 1e-4, 1 - 2e-4)};
    };
    auto [i, u] = place((x + relief.origin) / s.pitch_x, s.nx);
    const auto [j, v] = place((y + relief.origin) / s.pitch_y, s.ny);
    if (std::abs(u - v) < 1e-4) u = v + 1e-4;
    const RayBundle bundle =
        make_ray_bundle(relief.grid, to_vector({90, phi_deg}), {u >= v ? 0 : 1, u, v}, 8.0 * smooth_samples);
    float slope = 0;
    march_horizon(relief.grid, bundle, {i, j, 1, 1}, &slope);
    return {slope, relief.grid.highest * s.pitch_x - s.at(i, j)};
}

TEST(Horizon, Tables) {
    const nlohmann::json document = reference::load_json("horizon_tables");
    std::map<std::string, Relief> reliefs;
    int n = 0;
    for (const auto& entry : document.at("entries")) {
        const std::string name = entry.at("surface");
        if (!reliefs.contains(name)) reliefs.emplace(name, make_relief(name));
        const Relief& relief = reliefs.at(name);
        const double expected = entry.at("tan_horizon"), phi_deg = entry.at("phi");
        const Horizon found = march(relief, entry.at("x"), entry.at("y"), phi_deg);
        // Smooth reliefs and their facets differ by O(pitch^2). A rim is only known to a cell: seen from
        // `depth` below, at a distance of depth / tangent, that is a share pitch / distance of the tangent.
        double tolerance = relief.exact ? 2e-5 * (1 + expected) : 1e-3;
        if (relief.rims && expected > 0)
            tolerance += expected * expected / found.depth * std::sqrt(2) * relief.surface.pitch_x;
        EXPECT_NEAR(found.slope, expected, tolerance) << entry.dump();
        ++n;
    }
    EXPECT_EQ(n, 152);
}

// To O(pitch^2) in the middle of a cell: the grid that has the point there, as nearly as one can.
int samples_with_middle_at(double x) {
    int best = smooth_samples;
    const auto off_middle = [&](int n) { return std::abs(fractional_part(x * n) - 0.5); };
    for (int n = smooth_samples; n < smooth_samples + 40; ++n)
        if (off_middle(n) < off_middle(best)) best = n;
    return best;
}

TEST(Horizon, Sinusoids) {
    for (const char* name : {"sine_A0p08", "sine_A0p15", "sine_A0p3"}) {
        const reference::Case expected = reference::load_case(name);
        int n = 0;
        for (const auto& entry : expected.document.at("horizon_entries")) {
            const double x = entry.at("x");
            Relief relief;
            relief.surface = reference::surface(expected, samples_with_middle_at(x));
            relief.grid = make_march_grid(relief.surface);
            EXPECT_NEAR(march(relief, x, 0, entry.at("phi")).slope, entry.at("tan_horizon"), 1e-3)
                << name << entry.dump();
            ++n;
        }
        EXPECT_EQ(n, 36);
    }
}

}  // namespace
}  // namespace gonio
