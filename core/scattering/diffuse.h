// All orders of diffuse scattering for a batch of lights and views, kept apart: f(albedo) = sum albedo^k c_k.
#pragma once
#include <vector>

#include "scattering/link_operator.h"
#include "scattering/turned_light.h"

namespace gonio {

struct SeriesOptions {
    int max_order = 0;  // 0: all; K >= 1: scattering orders 1..K (order 1 is the direct term)
    // That multiply K, one sum each; the largest decides how often K is applied. {1} where channel factors
    // carry the albedo.
    std::vector<double> albedos{1.0};
    bool keep_orders = false;  // fill OrderSeries::orders: a product an order instead of two in all
    double tolerance = 1e-4;   // of what the sums miss, relative to the direct term
    int max_applications = 64;
    int fixed_applications = 0;  // > 0: apply K this often, whatever the tolerance: runs that are averaged
                                 // order by order must agree
    bool keep_first = false;     // fill OrderSeries::first
};

// Sums over the core of area-scaled products <g_view, K^k g_light>, lights x views.
struct OrderSeries {
    std::vector<Matrix> sums;    // one an albedo: sum over k >= 1 of albedo^k <g_view, K^k g_light>
    std::vector<Matrix> orders;  // if kept: [k - 1] is order k + 1 of scattering, albedo^k not included
    double ratio = 0;            // of one order to the one before, at the end, albedo not included
    double remainder = 0;  // error to expect of the sums, relative to the direct term; 0 for limited orders
    Fields first;          // if asked for: K applied once to the transported side
    int applications = 0;
};

// factors: sqrt(albedo) per slot of one channel of a map, or null. The irradiance must then carry it already.
OrderSeries diffuse_series(const LinkOperator& op, const Tile& tile, const Fields& lights,
                           const Fields& views, bool same_directions, const ChannelFactors* factors,
                           const SeriesOptions& options, int n_threads, const Monitor& monitor);

// The same on a curved base, where light and view are told in the frame of the point that is seen: lights are
// carried as turned_light does it, factors included, from the lights' side only. OrderSeries::first is K of
// the lights.
OrderSeries turned_series(const LinkOperator& op, const Tile& tile, TurnedLight lights, const Fields& views,
                          const ChannelFactors* factors, const SeriesOptions& options, int n_threads,
                          const Monitor& monitor);

}  // namespace gonio
