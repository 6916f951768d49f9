// All orders of diffuse scattering for a batch of lights and views, kept apart: f(albedo) = sum albedo^k c_k.
#pragma once
#include <optional>
#include <vector>

#include "scattering/link_operator.h"

namespace gonio {

struct SeriesOptions {
    int max_order = 0;          // 0: all; K >= 1: scattering orders 1..K (order 1 is the direct term)
    double largest_albedo = 1;  // that multiplies K (1 where channel factors carry the albedo)
    double tolerance = 1e-4;    // of what is left out, relative to the direct term
    int max_applications = 64;
    int fixed_applications = 0;  // > 0: apply K this often, whatever the tolerance: runs that are averaged
                                 // order by order must agree
    int average_to = 0;  // r >= 1: after each application, average over the facet parts that refinement r
                         // does not tell apart
    bool keep_first = false;  // fill OrderSeries::first
    // Sum the orders of this one albedo at once: two products in all instead of one an order.
    std::optional<double> combine;
};

// higher[k - 1] (lights x views): sum over the core of area-scaled products <g_view, K^k g_light>, order k +
// 1 of scattering, albedo^k not included; or, combined, their sum with albedo^k and the remainder included.
struct OrderSeries {
    std::vector<Matrix> higher;
    // What is beyond the last order continues as a geometric series with this ratio per order (albedo not
    // included): the light has forgotten where it came from. 0 if the orders were limited by the job.
    double ratio = 0;
    Fields first;          // if asked for: K applied once to the transported side
    double remainder = 0;  // relative size of that continuation, for the bias estimate
    int applications = 0;
};

// Relative error to expect of the geometric continuation, as a share of the continuation itself: decides when
// to stop, and goes into the bias.
inline constexpr double series_continuation_error = 0.5;

// factors: sqrt(albedo) per slot of one channel of a map, or null. The irradiance must then carry it already.
OrderSeries diffuse_series(const LinkOperator& op, const Tile& tile, const Fields& lights,
                           const Fields& views, bool same_directions, const ChannelFactors* factors,
                           const SeriesOptions& options, int n_threads, const Monitor& monitor);

}  // namespace gonio
