// Sky factors by slices against closed forms: E / (pi L) of points in grooves, pits, holes and boxes under a
// uniform sky, with their exact horizons. The errors that a finite number of azimuths makes are part of the
// reference answers and are met, too.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "scattering/environment_slices.h"
#include "validation/reference_data.h"

namespace gonio {
namespace {

double number(const std::string& what, const std::string& key) {
    return std::stod(what.substr(what.find(key) + key.size()));
}

// Distance along phi from (x, 0) to the circle of that radius around the origin.
double to_circle(double x, double radius, double phi) {
    return -x * std::cos(phi) + std::sqrt(radius * radius - std::pow(x * std::sin(phi), 2));
}

// Slope of the exact horizon.
double horizon(const std::string& what, double x, double phi) {
    const double c = std::cos(phi), s = std::sin(phi);
    if (what.starts_with("V-groove")) {
        const double slope = std::tan(radians(number(what, "alpha=")));
        return c > 0 ? slope * c : slope * -c * (1 - x) / (1 + x);
    }
    if (what.starts_with("rect")) {
        const double width = number(what, "a="), depth = number(what, " d=");
        return depth * std::abs(c) / (c > 0 ? width - x : x);
    }
    if (what.starts_with("spherical")) {
        const double eta = radians(number(what, "eta=")), depth = std::sqrt(1 - x * x) - std::cos(eta);
        return depth / to_circle(x, std::sin(eta), phi);
    }
    if (what.starts_with("cylindrical")) return number(what, "depth=") / to_circle(x, 1, phi);
    if (what.starts_with("conical")) return std::tan(radians(number(what, "slope ")));
    if (what.starts_with("square")) return number(what, "depth ") * std::max(std::abs(c), std::abs(s));
    throw std::runtime_error("unknown surface " + what);
}

TEST(Ambient, SkyFactorsAndTheirErrorsWithFewAzimuths) {
    const nlohmann::json document = reference::load_json("ambient_horizon");
    const Environment sky = uniform_environment({1 / pi});
    int n = 0;
    for (const auto& entry : document.at("entries")) {
        const std::string what = entry.at("what");
        if (what.starts_with("infinite plane")) continue;  // its sky reaches below the horizon
        const auto normal = entry.at("normal").get<std::vector<double>>();
        for (const auto& [azimuths, error] : entry.at("error_of_N_slice_sum_exact_horizons").items()) {
            const std::vector<double> phi = uniform_azimuths(std::stoi(azimuths), 0);
            const std::vector<SkySlice> slices = sky_slices(sky, phi);
            double sum = 0;
            for (size_t k = 0; k < phi.size(); ++k)
                slices[k].add(horizon(what, entry.at("x"), phi[k]), {normal[0], normal[1], normal[2]}, &sum);
            EXPECT_NEAR(sum, entry.at("E_over_piL").get<double>() + error.get<double>(), 1e-6)
                << what << ", " << azimuths;
            ++n;
        }
    }
    EXPECT_EQ(n, 20 * 5);
}

}  // namespace
}  // namespace gonio
