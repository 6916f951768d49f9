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

}  // namespace
}  // namespace gonio
