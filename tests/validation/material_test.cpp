// Facet reflectances against the reference answers flat_plane: the value of every lobe.
#include <gtest/gtest.h>

#include "material/facet_brdf.h"
#include "surface/generate.h"
#include "validation/reference_data.h"

namespace gonio {
namespace {

TEST(Materials, FlatPlanesAreExact) {
    const HeightField plane = generate_plane(2, 1);
    for (const char* name : {"flat_plane", "flat_plane_b"}) {
        int n = 0;
        const nlohmann::json document = reference::load_json(name);
        for (const auto& entry : document.at("entries")) {
            const std::optional<Lobe> lobe = reference::lobe_of(entry.at("micro"));
            if (!lobe) continue;
            const Material material({"y"}, *lobe);
            std::vector<double> f(1);
            FacetBrdf(material, plane, 0, 0, 0)
                .eval(to_vector(reference::angles_of(entry.at("wi"))),
                      to_vector(reference::angles_of(entry.at("wo"))), f);
            const double value = entry.at("value");
            EXPECT_NEAR(f[0], value, 1e-11 * value + 1e-13) << name << ": " << entry;
            ++n;
        }
        EXPECT_GE(n, 40) << name;
    }
}

Material white_microfacets(const nlohmann::json& entry) {
    const double alpha = entry.at("alpha");
    return {{"y"},
            Microfacet{
                entry.at("ndf") == "ggx" ? Microfacet::Distribution::ggx : Microfacet::Distribution::beckmann,
                alpha,
                alpha,
                0.0,
                {1.0, {}, {}}}};
}

// Smith's single reflection is what the lobes are: f1 of smith_multiscatter_brdf.
TEST(Materials, MicrofacetsAreSmithsSingleReflection) {
    const HeightField plane = generate_plane(2, 1);
    const nlohmann::json document = reference::load_json("smith_multiscatter_brdf");
    for (const auto& entry : document.at("entries")) {
        double f = 0;
        FacetBrdf(white_microfacets(entry), plane, 0, 0, 0)
            .eval(to_vector(reference::angles_of(entry.at("wi"))),
                  to_vector(reference::angles_of(entry.at("wo"))), {&f, 1});
        const double f1 = entry.at("f1");
        EXPECT_NEAR(f, f1, 1e-4 * f1 + entry.at("uncertainty_f1_f2").get<double>()) << entry;
    }
    EXPECT_EQ(document.at("entries").size(), 84u);
}

// What they reflect in all is what leaves after one reflection of Smith's walk: E1, by sampling.
TEST(Materials, MicrofacetsReflectSmithsFirstOrder) {
    const HeightField plane = generate_plane(2, 1);
    constexpr int n = 16384;
    int compared = 0;
    for (const char* name : {"smith_multiscatter_energy", "smith_multiscatter_energy_b"}) {
        const nlohmann::json document = reference::load_json(name);
        for (const auto& entry : document.at("entries")) {
            const Material material = white_microfacets(entry);
            const FacetBrdf facet(material, plane, 0, 0, 0);
            const Vec3 wo = to_vector({entry.at("theta_i").get<double>(), 25});
            double reflected = 0;
            for (int k = 0; k < n; ++k) {  // R2 (Roberts 2018): rare slopes count
                double weight = 0;
                if (facet.sample(wo, 0.5, fractional_part(0.5 + k * 0.7548776662466927),
                                 fractional_part(0.5 + k * 0.5698402909980532), {&weight, 1}))
                    reflected += weight / n;
            }
            EXPECT_NEAR(reflected, entry.at("E1_quadrature"), 1e-3) << name << ": " << entry;
            ++compared;
        }
    }
    EXPECT_EQ(compared, 100);
}

}  // namespace
}  // namespace gonio
