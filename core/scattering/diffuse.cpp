#include "scattering/diffuse.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "scattering/series_weights.h"

namespace gonio {
namespace {

// K with the albedo map of one channel around it, and products over the core.
class Transport {
  public:
    Transport(const LinkOperator& op, const Tile& tile, const ChannelFactors* factors, int n_threads)
        : op_(op), tile_(tile), factors_(factors), n_threads_(n_threads) {}

    Fields next(const Fields& x) const {
        Fields y(x.n_unknowns(), x.n_columns());
        if (!factors_) {
            apply(op_, x, y, n_threads_);
            return y;
        }
        Fields scaled = x;
        scale(scaled);
        apply(op_, scaled, y, n_threads_);
        scale(y);
        return y;
    }
    TurnedLight next(TurnedLight x) const {
        for (Fields& f : x.coefficients) scale(f);
        TurnedLight y = apply(op_, x, n_threads_);
        for (Fields& f : y.coefficients) scale(f);
        return y;
    }
    void add(const Combination& a, const Combination& b, Matrix& sum) const {
        add_products(tile_, a, b, 1.0, n_threads_, sum);
    }

  private:
    void scale(Fields& fields) const {
        if (factors_) scale_rows(fields, tile_, *factors_, n_threads_);
    }
    const LinkOperator& op_;
    const Tile& tile_;
    const ChannelFactors* factors_;
    int n_threads_;
};

// Light is lost to the sky at every bounce: a ratio closer to 1 is sampling noise.
constexpr double largest_ratio = 0.99;

// How the light falls off from order to order, and so where the series may end.
class Decline {
  public:
    explicit Decline(const Fields& start) : norms_{sampled_inner_product(start, start)} {}

    // False if no light is left.
    bool add(const Fields& before, const Fields& after) {
        const double norm = sampled_inner_product(after, after);
        if (!(norm > 0)) return ratio_ = 0, false;
        // From the norms. The products <g, K^2 g> / <g, K g> would tell more, but mislead where light bounces
        // between two walls (K has eigenvalues +x and -x, and odd orders nearly vanish). After one
        // application the norm still falls too fast, and they are needed.
        const double by_norm = std::sqrt(norm / norms_.back()),
                     odd = norms_.size() == 1 ? sampled_inner_product(before, after) : 0.0;
        ratio_ = std::min(odd > 0 ? std::min(norm / odd, 2 * by_norm) : by_norm, largest_ratio);
        norms_.push_back(norm);
        return true;
    }
    double ratio() const { return ratio_; }

    // The ratio comes from below as the light forgets where it came from: measured at slopes 0.3 to 1.5, the
    // spectrum that matters ends 1.1 to 1.4 times higher.
    SeriesWeights weights(int n_orders, double albedo) const {
        const double x = albedo * ratio_;
        return series_weights(n_orders, std::min(1.25 * x, (1 + x) / 2));
    }
    double remainder(int n_orders, double albedo) const {
        const SeriesWeights weighed = weights(n_orders, albedo);
        const double x = albedo * ratio_;
        // <g, K^zeros g>, or the even power below.
        const size_t half = std::min<size_t>(norms_.size() - 1, weighed.zeros / 2);
        // rms of a residual that oscillates. Measured at slopes 0.3 to 1.5 and in a deep groove, the error is
        // 0.05 to 0.9 of the bound (0.8 to 0.9 where the residual keeps its sign).
        const double typical = n_orders + 1 - weighed.zeros > 1 ? std::sqrt(0.5) : 1.0;
        return typical * std::pow(albedo, 2.0 * static_cast<double>(half)) * norms_[half] / norms_[0] /
               (1 - x) * weighed.largest;
    }

  private:
    std::vector<double> norms_;  // <K^k g, K^k g>
    double ratio_ = 0;
};

bool enough(const OrderSeries& series, const SeriesOptions& options) {
    if (options.fixed_applications > 0) return series.applications >= options.fixed_applications;
    return options.max_order == 0 && series.remainder < options.tolerance;
}

double largest_albedo(const SeriesOptions& options) {
    return *std::max_element(options.albedos.begin(), options.albedos.end());
}

// albedo^k times the weight of each order k = 1..n.
std::vector<double> scaled_weights(const Decline& decline, const SeriesOptions& options, int n_orders,
                                   double albedo) {
    std::vector<double> weights = options.max_order == 0 ? decline.weights(n_orders, albedo).of_order
                                                         : std::vector<double>(n_orders, 1.0);
    for (int k = 0; k < n_orders; ++k) weights[k] *= std::pow(albedo, k + 1);
    return weights;
}

void sum_orders(const Decline& decline, const SeriesOptions& options, OrderSeries& result) {
    for (const double albedo : options.albedos) {
        Matrix sum(result.orders[0].rows, result.orders[0].columns);
        const std::vector<double> weights =
            scaled_weights(decline, options, static_cast<int>(result.orders.size()), albedo);
        for (size_t k = 0; k < result.orders.size(); ++k)
            for (size_t i = 0; i < sum.values.size(); ++i)
                sum.values[i] += weights[k] * result.orders[k].values[i];
        result.sums.push_back(std::move(sum));
    }
    if (!options.keep_orders) result.orders.clear();
}

// Lights are the views: M applications give 2 M orders, c_{a+b} = <K^a g_v, K^b g_l>.
OrderSeries symmetric_series(const Transport& transport, const Fields& g, const SeriesOptions& options,
                             const Monitor& monitor) {
    OrderSeries result;
    const int wanted = options.max_order == 0 ? std::numeric_limits<int>::max() : options.max_order - 1;
    const double most = largest_albedo(options);
    Decline decline(g);
    std::vector<Fields> carried;  // K g, K^2 g, ...
    auto power = [&](int k) { return k == 0 ? &g : &carried[k - 1]; };
    while (2 * result.applications < wanted && result.applications < options.max_applications) {
        monitor.check_cancelled();
        carried.push_back(transport.next(*power(result.applications)));
        ++result.applications;
        const bool lit = decline.add(*power(result.applications - 1), carried.back());
        result.remainder = lit ? decline.remainder(2 * result.applications, most) : 0.0;
        if (!lit || enough(result, options)) break;
    }
    const int m = result.applications, n_orders = std::min(wanted, 2 * m);
    if (m == 0) return result;
    if (options.max_order == 0) result.ratio = decline.ratio();
    if (options.max_order != 0) result.remainder = 0;

    const int n = g.n_columns();
    if (options.keep_orders || options.albedos.size() > 1) {
        for (int k = 1; k <= n_orders; ++k) {
            const Combination a{{power((k + 1) / 2), 1}}, b{{power(k / 2), 1}};
            result.orders.emplace_back(n, n);
            transport.add(a, k % 2 == 0 ? a : b, result.orders.back());
        }
        sum_orders(decline, options, result);
    } else {
        // <g, sum_{k<=m} w_k K^k g> + <K^m g, sum_{k<=m} w_{m+k} K^k g>
        const std::vector<double> weights = scaled_weights(decline, options, n_orders, most);
        Combination low, high;
        for (int k = 1; k <= m; ++k) {
            low.push_back({power(k), weights[k - 1]});
            if (m + k <= n_orders) high.push_back({power(k), weights[m + k - 1]});
        }
        result.sums.emplace_back(n, n);
        transport.add({{&g, 1}}, low, result.sums[0]);
        if (!high.empty()) transport.add({{power(m), 1}}, high, result.sums[0]);
    }
    if (options.keep_first) result.first = std::move(carried[0]);
    return result;
}

// Transports one side, meets the other one at every order. next: from one order to the next.
OrderSeries one_sided_series(const Transport& transport, const Fields& lights, const Fields& views,
                             bool from_lights, const std::function<Fields(const Fields&)>& next,
                             const SeriesOptions& options, const Monitor& monitor) {
    OrderSeries result;
    const int wanted = options.max_order == 0 ? std::numeric_limits<int>::max() : options.max_order - 1;
    const bool apart = options.keep_orders || options.albedos.size() > 1;
    const Fields& source = from_lights ? lights : views;
    auto meet = [&](const Combination& carried) {
        Matrix m(lights.n_columns(), views.n_columns());
        if (from_lights)
            transport.add(carried, {{&views, 1}}, m);
        else
            transport.add({{&lights, 1}}, carried, m);
        return m;
    };
    const double most = largest_albedo(options);
    Decline decline(source);
    std::vector<Fields> carried;  // apart: the last one; else all of them
    while (result.applications < wanted && result.applications < 2 * options.max_applications) {
        monitor.check_cancelled();
        const Fields& before = carried.empty() ? source : carried.back();
        Fields after = next(before);
        const bool lit = decline.add(before, after);
        if (options.keep_first && result.applications == 0) result.first = after;
        if (apart) carried.clear();
        carried.push_back(std::move(after));
        ++result.applications;
        if (apart) result.orders.push_back(meet({{&carried.back(), 1}}));
        result.remainder = lit ? decline.remainder(result.applications, most) : 0.0;
        if (!lit || enough(result, options)) break;
    }
    if (result.applications == 0) return result;
    if (options.max_order == 0) result.ratio = decline.ratio();
    if (options.max_order != 0) result.remainder = 0;
    if (apart) {
        sum_orders(decline, options, result);
    } else {
        const std::vector<double> weights = scaled_weights(decline, options, result.applications, most);
        Combination sum;
        for (size_t k = 0; k < carried.size(); ++k) sum.push_back({&carried[k], weights[k]});
        result.sums.push_back(meet(sum));
    }
    return result;
}

}  // namespace

OrderSeries diffuse_series(const LinkOperator& op, const Tile& tile, const Fields& lights,
                           const Fields& views, bool same_directions, const ChannelFactors* factors,
                           const SeriesOptions& options, int n_threads, const Monitor& monitor) {
    const Transport transport(op, tile, factors, n_threads);
    if (same_directions) return symmetric_series(transport, lights, options, monitor);
    // The smaller set is transported.
    return one_sided_series(
        transport, lights, views, lights.n_columns() <= views.n_columns(),
        [&](const Fields& x) { return transport.next(x); }, options, monitor);
}

OrderSeries turned_series(const LinkOperator& op, const Tile& tile, TurnedLight lights, const Fields& views,
                          const ChannelFactors* factors, const SeriesOptions& options, int n_threads,
                          const Monitor& monitor) {
    const Transport transport(op, tile, factors, n_threads);
    const Fields first = lights.coefficients[0];
    return one_sided_series(
        transport, first, views, true,
        [&](const Fields&) {
            lights = transport.next(std::move(lights));
            return lights.coefficients[0];
        },
        options, monitor);
}

}  // namespace gonio
