#include "scattering/turned_radiosity.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace gonio {
namespace {

// Light is lost to the sky at every bounce: a ratio closer to 1 is sampling noise.
constexpr double largest_ratio = 0.99;

// to += factors of the slots (1 where there are none) * factor * from.
void add(const Fields& from, const Tile& tile, const ChannelFactors* factors, double factor, int n_threads,
         Fields& to) {
    constexpr size_t chunk = 2048;
    parallel_for(static_cast<int>((from.n_unknowns() + chunk - 1) / chunk), n_threads, [&](int task) {
        for (int block = 0; block < from.n_blocks(); ++block)
            for (size_t u = task * chunk; u < std::min(from.n_unknowns(), (task + 1) * chunk); ++u) {
                const double weight = factors ? factor * (*factors)[u % tile.n_slots()] : factor;
                for (size_t c = u * column_block; c < (u + 1) * column_block; ++c)
                    to.block(block)[c] += static_cast<float>(weight * from.block(block)[c]);
            }
    });
}

// Orders 2 and up of one albedo map, or of all channels if the operators need not know the albedo.
void add_orders(const std::array<LinkOperator, 2>& operators, const Tile& tile, const ChannelFactors* map,
                const ChannelFactors& inverse_root, const std::vector<double>& albedos,
                const RadiosityOptions& options, TurnedLight light, int n_threads, const Monitor& monitor,
                std::vector<Fields*> sums, TurnedRadiosity& result) {
    auto norm_of = [](const TurnedLight& x) {
        return std::sqrt(sampled_inner_product(x.coefficients[0], x.coefficients[0]));
    };
    const double most = *std::max_element(albedos.begin(), albedos.end()), first_norm = norm_of(light);
    const int wanted = options.max_order == 0 ? options.max_applications : options.max_order - 1;
    double norm = first_norm;
    std::vector<double> powers = albedos;
    for (int k = 0; k < wanted && norm > 0; ++k) {
        monitor.check_cancelled();
        if (map)
            for (Fields& f : light.coefficients) scale_rows(f, tile, *map, n_threads);
        light = apply(operators[k % 2], light, n_threads);
        for (size_t c = 0; c < albedos.size(); ++c) {
            powers[c] *= albedos[c];
            Fields order = light.coefficients[0];
            scale_rows(order, tile, inverse_root, n_threads);
            add(order, tile, map, powers[c], n_threads, *sums[c]);
        }
        result.applications = std::max(result.applications, k + 1);
        if (options.max_order != 0) continue;
        const double now = norm_of(light), ratio = std::min(most * now / norm, largest_ratio);
        norm = now;
        const double remainder = std::pow(most, k + 1) * now / first_norm * ratio / (1 - ratio);
        if (remainder < options.tolerance || k + 1 == wanted) {
            result.remainder = std::max(result.remainder, remainder);
            break;
        }
    }
}

}  // namespace

void turned_radiosity(const std::array<LinkOperator, 2>& operators, const Tile& tile,
                      const FacetAlbedo& albedo, const RadiosityOptions& options, const TurnedLight& light,
                      int n_threads, const Monitor& monitor, TurnedRadiosity& result) {
    const Fields& straight = light.coefficients[0];
    ChannelFactors inverse_root(tile.n_slots());
    for (size_t slot = 0; slot < tile.n_slots(); ++slot)
        inverse_root[slot] = tile.sqrt_area[slot] > 0 ? 1 / tile.sqrt_area[slot] : 0;
    TurnedLight scaled = light;
    for (Fields& f : scaled.coefficients) scale_rows(f, tile, tile.sqrt_area, n_threads);
    result.of_channel.clear();
    std::vector<Fields*> sums;
    result.of_channel.reserve(albedo.n_channels());
    for (size_t c = 0; c < albedo.n_channels(); ++c) {
        Fields& sum = result.of_channel.emplace_back(straight.n_unknowns(), straight.n_columns());
        std::fill(sum.values().begin(), sum.values().end(), 0.0f);
        const ChannelFactors* map = albedo.maps.empty() ? nullptr : &albedo.maps[c];
        add(straight, tile, map, map ? 1 : albedo.constant[c], n_threads, sum);
        sums.push_back(&sum);
        if (map)
            add_orders(operators, tile, map, inverse_root, {1.0}, options, scaled, n_threads, monitor, {&sum},
                       result);
    }
    if (albedo.maps.empty())
        add_orders(operators, tile, nullptr, inverse_root, albedo.constant, options, std::move(scaled),
                   n_threads, monitor, sums, result);
}

}  // namespace gonio
