// Spherical harmonics and zonal lobes against the reference answers sh_*.json of data/.
#include <gtest/gtest.h>

#include "directions/spherical_harmonics.h"
#include "fitting/projection_directions.h"
#include "fitting/sh_projection.h"
#include "validation/load_json.h"

namespace gonio {
namespace {

// The files print twelve digits.
constexpr double printed = 1e-12;

TEST(Harmonics, Basis) {
    const auto document = reference::load_json("sh_basis");
    for (const auto& entry : document.at("entries")) {
        const auto& angles = entry.at("theta_phi");
        const std::vector<double> expected = entry.at("values");
        std::vector<double> y(expected.size());
        sh_basis(6, to_vector({angles.at(0), angles.at(1)}), y);
        ASSERT_EQ(y.size(), 36u);
        for (size_t k = 0; k < y.size(); ++k)
            EXPECT_NEAR(y[k], expected[k], 2 * printed) << angles << ", " << k;
    }
}

TEST(Harmonics, ClampedCosine) {
    const std::vector<double> eigenvalues = cosine_lobe_eigenvalues(13, 1);
    const auto document = reference::load_json("sh_clamped_cosine");
    for (const auto& entry : document.at("entries")) {
        const int l = entry.at("l");
        EXPECT_NEAR(pi * eigenvalues[l], entry.at("A_l_ramamoorthi"), 5 * printed);
        const double zonal = zonal_lobe(eigenvalues, {0, 0, 1})[harmonic_index(l, 0)];
        EXPECT_NEAR(pi * zonal, entry.at("zh_coefficient"), 5 * printed);
    }
}

TEST(Harmonics, PhongLobes) {
    for (const char* name : {"sh_phong_zh", "sh_phong_zh_b"}) {
        const auto document = reference::load_json(name);
        for (const auto& entry : document.at("entries")) {
            const std::vector<double> expected = entry.at("exact_Lambda_l");
            const std::vector<double> found =
                cosine_lobe_eigenvalues(static_cast<int>(expected.size()), entry.at("S"));
            for (size_t l = 0; l < expected.size(); ++l) EXPECT_NEAR(found[l], expected[l], printed);
        }
    }
}

// c_lm = int f cos_i y_lm(wi) dwi for a fixed wo: that one stands for the light of a projection per light, g
// is given with its cosine. The grid of order 20 resolves these lobes; values are floats.
TEST(Harmonics, BrdfProjection) {
    ProjectionPlan plan;
    plan.basis = ProjectionPlan::Basis::sh;
    plan.order = 20;
    plan.weighting = ProjectionPlan::Weighting::none;
    const auto document = reference::load_json("sh_brdf_projection");
    for (const auto& entry : document.at("entries")) {
        AnglesDeg wo{0, 0};
        if (entry.at("wo").is_array()) wo = {entry.at("wo").at(0), entry.at("wo").at(1)};
        BrdfPlan directions;
        directions.incident = {wo};
        directions.project = plan;
        set_projection_directions(directions);
        Table table;
        table.channels = {"y"};
        table.incident = directions.incident;
        table.outgoing = directions.outgoing;
        const Vec3 mirrored{-to_vector(wo).x, -to_vector(wo).y, to_vector(wo).z};
        for (const AnglesDeg& angles : table.outgoing) {
            const Vec3 wi = to_vector(angles);
            double f = 1 / pi;
            if (entry.contains("exponent")) {
                const double n = entry.at("exponent");
                f = (n + 2) / (2 * pi) * std::pow(std::max(0.0, dot(wi, mirrored)), n);
            }
            table.f.push_back(static_cast<float>(f * wi.z));
        }
        table.se = table.bias = std::vector<float>(table.f.size());
        const HarmonicProjection found = project(table, plan);
        const std::vector<double> expected = entry.at("coefficients_l0_5");
        for (size_t k = 0; k < expected.size(); ++k)
            EXPECT_NEAR(found.coefficients[k], expected[k], 1e-6) << entry.at("wo");
    }
}

}  // namespace
}  // namespace gonio
