// What the path tracer sees of a relief under an environment, and an environment to see it by.
#pragma once
#include <cmath>

#include "scattering/path_tracer.h"

namespace gonio::test {

struct Traced {
    double radiance = 0, se = 0;
};
// Mean radiance towards the view, first channel.
inline Traced trace(const HeightField& surface, const Material& material, const Environment& sky,
                    const Vec3& view, const PathTracerOptions& options) {
    const PathTracer tracer(surface, material, options);
    double sum = 0, spread = 0;
    for (int block = 0; block < tracer.blocks(); ++block) {
        const PathTally tally = tracer.trace_environment(0, view, sky, block, {});
        sum += tally.sum[0], spread += tally.squared_spread[0];
    }
    return {tracer.scale() * sum, tracer.scale() * std::sqrt(spread)};
}

// Bright to one side, and of no single harmonic of the azimuth.
inline Environment uneven_sky() {
    Environment sky;
    sky.nx = 128, sky.ny = 64, sky.n_channels = 1, sky.rotation = 0.4;
    for (int j = 0; j < sky.ny; ++j)
        for (int i = 0; i < sky.nx; ++i) {
            const double across = std::cos(2 * pi * (i - 40.5) / sky.nx) * std::sin(pi * (j + 0.5) / sky.ny);
            sky.radiance.push_back(static_cast<float>(0.3 + std::exp(3 * across)));
        }
    return sky;
}

}  // namespace gonio::test
