// What tests of reliefs under environments share: materials from lobes, a relief, agreement with the path
// tracer.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "agreement/traced_sky.h"
#include "measure/relight.h"
#include "surface/generate.h"

namespace gonio::test {

inline Material of(std::vector<WeightedLobe> lobes, std::vector<std::string> channels = {"y"}) {
    Material material;
    material.channels = std::move(channels);
    material.lobes = std::move(lobes);
    return material;
}

inline HeightField relit_field() {
    return generate_gaussian(48, 48, 1, 6, 0.8, 4);
}

// The means over relit_field() within 3.5 sigma of the path tracer's, and both known well enough to tell:
// bias at most `most_bias` of the mean.
inline void expect_what_paths_see(const Relit& lit, const Material& material, const Environment& sky,
                                  const std::vector<AnglesDeg>& views, const PathTracerOptions& options,
                                  double most_bias) {
    for (size_t v = 0; v < views.size(); ++v) {
        const Traced traced = trace(relit_field(), material, sky, to_vector(views[v]), options);
        EXPECT_NEAR(lit.mean[v], traced.radiance, 3.5 * std::hypot(lit.se[v], traced.se) + lit.bias[v])
            << "view " << v;
        EXPECT_LT(traced.se, 0.02 * traced.radiance);
        EXPECT_LT(lit.se[v], 0.01 * lit.mean[v]);
        EXPECT_LT(lit.bias[v], most_bias * lit.mean[v]);
    }
}

}  // namespace gonio::test
