#include "scattering/radiosity.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace gonio {
namespace {

// Light is lost to the sky at every bounce: a ratio closer to 1 is sampling noise.
constexpr double largest_ratio = 0.99;
constexpr size_t chunk = 1 << 16;

template <class Operation>
void for_values(size_t size, int n_threads, Operation&& operation) {
    parallel_for(static_cast<int>((size + chunk - 1) / chunk), n_threads,
                 [&](int k) { operation(k * chunk, std::min(size, (k + 1) * chunk)); });
}

Fields scaled(const Fields& from, double factor, int n_threads) {
    Fields to(from.n_unknowns(), from.n_columns());
    for_values(to.values().size(), n_threads, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) to.values()[i] = static_cast<float>(factor) * from.values()[i];
    });
    return to;
}

void add(const Fields& from, double factor, int n_threads, Fields& to) {
    for_values(to.values().size(), n_threads, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) to.values()[i] += static_cast<float>(factor) * from.values()[i];
    });
}

// sum of weight_c albedo_c^k K^k g over the orders, for all channels at once: K does not know the albedo.
void sum_orders(const LinkOperator& op, const Tile& tile, const Fields& g, const ChannelFactors* map,
                const std::vector<double>& albedos, const RadiosityOptions& options, int n_threads,
                const Monitor& monitor, Fields* sums, Radiosity& result) {
    const double most = *std::max_element(albedos.begin(), albedos.end());
    const int wanted = options.max_order == 0 ? options.max_applications : options.max_order - 1;
    const double first_norm = std::sqrt(sampled_inner_product(g, g));
    double norm = first_norm;
    const Fields* before = &g;
    Fields carried, next;
    std::vector<double> powers(albedos.size(), 1.0);
    for (int k = 0; k < wanted && norm > 0; ++k) {
        monitor.check_cancelled();
        next = Fields(g.n_unknowns(), g.n_columns());
        if (map) {
            Fields weighed = *before;
            scale_rows(weighed, tile, *map, n_threads);
            apply(op, weighed, next, n_threads);
            scale_rows(next, tile, *map, n_threads);
        } else {
            apply(op, *before, next, n_threads);
        }
        for (size_t c = 0; c < albedos.size(); ++c) {
            powers[c] *= albedos[c];
            add(next, powers[c] * albedos[c], n_threads, sums[c]);
        }
        carried = std::move(next);
        before = &carried;
        result.applications = std::max(result.applications, k + 1);
        if (options.max_order != 0) continue;
        const double now = std::sqrt(sampled_inner_product(carried, carried)),
                     ratio = std::min(most * now / norm, largest_ratio);
        norm = now;
        const double remainder = std::pow(most, k + 1) * now / first_norm * ratio / (1 - ratio);
        if (remainder < options.tolerance || k + 1 == wanted) {
            result.remainder = std::max(result.remainder, remainder);
            break;
        }
    }
}

}  // namespace

Radiosity diffuse_radiosity(const LinkOperator* op, const Tile& tile, const Fields& irradiance,
                            const std::vector<double>& albedos, const std::vector<ChannelFactors>& maps,
                            const RadiosityOptions& options, int n_threads, const Monitor& monitor) {
    Radiosity result;
    for (const double albedo : albedos) result.of_channel.push_back(scaled(irradiance, albedo, n_threads));
    if (maps.empty()) {
        if (op)
            sum_orders(*op, tile, irradiance, nullptr, albedos, options, n_threads, monitor,
                       result.of_channel.data(), result);
        return result;
    }
    // sqrt(albedo) on both sides keeps the operator self-adjoint; what leaves the facet carries both roots.
    for (const ChannelFactors& map : maps) {
        Fields g = irradiance;
        scale_rows(g, tile, map, n_threads);
        Fields sum = scaled(g, 1, n_threads);
        if (op) sum_orders(*op, tile, g, &map, {1.0}, options, n_threads, monitor, &sum, result);
        scale_rows(sum, tile, map, n_threads);
        result.of_channel.push_back(std::move(sum));
    }
    return result;
}

}  // namespace gonio
