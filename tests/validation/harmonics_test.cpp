// Spherical harmonics and zonal lobes against the reference answers sh_*.json of data/.
#include <gtest/gtest.h>

#include "directions/spherical_harmonics.h"
#include "validation/load_json.h"

namespace gonio {
namespace {

// The files print twelve digits.
constexpr double printed = 1e-12;

TEST(Harmonics, Basis) {
    for (const auto& entry : reference::load_json("sh_basis").at("entries")) {
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
    for (const auto& entry : reference::load_json("sh_clamped_cosine").at("entries")) {
        const int l = entry.at("l");
        EXPECT_NEAR(pi * eigenvalues[l], entry.at("A_l_ramamoorthi"), 5 * printed);
        const double zonal = zonal_lobe(eigenvalues, {0, 0, 1})[harmonic_index(l, 0)];
        EXPECT_NEAR(pi * zonal, entry.at("zh_coefficient"), 5 * printed);
    }
}

TEST(Harmonics, PhongLobes) {
    for (const char* name : {"sh_phong_zh", "sh_phong_zh_b"})
        for (const auto& entry : reference::load_json(name).at("entries")) {
            const std::vector<double> expected = entry.at("exact_Lambda_l"),
                                      found = cosine_lobe_eigenvalues(static_cast<int>(expected.size()),
                                                                      entry.at("S"));
            for (size_t l = 0; l < expected.size(); ++l) EXPECT_NEAR(found[l], expected[l], printed);
        }
}

}  // namespace
}  // namespace gonio
