// The light that every facet part sends back: all orders of diffuse scattering summed where they arrive, for
// pictures of the relief (diffuse.h sums them where they are seen, for tables). The same sampled K is applied
// again and again, and E[K K] is not E[K] E[K]: all orders come out 0.17 % too bright with 32 directions a
// facet part, slope 0.7 and albedo 0.8, falling with their number (0.03 % with 128).
#pragma once
#include <vector>

#include "scattering/link_operator.h"

namespace gonio {

struct RadiosityOptions {
    int max_order = 0;        // 0: all; K >= 1: scattering orders 1..K (order 1 is light from the lamps)
    double tolerance = 1e-4;  // of what is left out of all orders, relative to the first
    int max_applications = 256;
};

struct Radiosity {
    // sqrt(area) albedo E of a channel each, [unknown][light]: E is the irradiance of all orders, in units of
    // what a surface that faces the light receives.
    std::vector<Fields> of_channel;
    int applications = 0;
    double remainder = 0;  // rms of what is left out, relative to the first order
};

// irradiance: of light_irradiance(). albedos: one a channel; empty if `maps` (sqrt(albedo) per slot, one a
// channel) is given instead. op: null for the first order alone.
Radiosity diffuse_radiosity(const LinkOperator* op, const Tile& tile, const Fields& irradiance,
                            const std::vector<double>& albedos, const std::vector<ChannelFactors>& maps,
                            const RadiosityOptions& options, int n_threads, const Monitor& monitor);

}  // namespace gonio
