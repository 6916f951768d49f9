#include "scattering/diffuse.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace gonio {
namespace {

class Series {
  public:
    Series(const LinkOperator& op, const Tile& tile, const ChannelFactors* factors, int average_to,
           int n_threads)
        : op_(op), tile_(tile), factors_(factors), average_to_(average_to), n_threads_(n_threads) {}

    Fields next(const Fields& x) const {
        Fields y(x.n_unknowns(), x.n_columns());
        if (!factors_) {
            apply(op_, x, y, n_threads_);
            if (average_to_ > 0) average_parts(tile_, average_to_, n_threads_, y);
            return y;
        }
        Fields scaled = x;
        scale_rows(scaled, tile_, *factors_, n_threads_);
        apply(op_, scaled, y, n_threads_);
        scale_rows(y, tile_, *factors_, n_threads_);
        return y;
    }
    Matrix products(const Combination& a, const Combination& b) const {
        Matrix m(a[0].fields->n_columns(), b[0].fields->n_columns());
        add_products(tile_, a, b, 1.0, n_threads_, m);
        return m;
    }

  private:
    const LinkOperator& op_;
    const Tile& tile_;
    const ChannelFactors* factors_;
    int average_to_, n_threads_;
};

void add_scaled(const Matrix& from, double scale, Matrix& to) {
    for (size_t k = 0; k < to.values.size(); ++k) to.values[k] += scale * from.values[k];
}

// Light is lost to the sky at every bounce: a ratio closer to 1 is sampling noise, and its continuation would
// be, too.
constexpr double largest_ratio = 0.99;

// Relative size of the geometric continuation after a last order that holds `share` of the direct term.
double continuation(double share, double ratio) {
    return ratio < 1 ? share * ratio / (1 - ratio) : std::numeric_limits<double>::infinity();
}

bool enough(const OrderSeries& series, const SeriesOptions& options) {
    if (options.fixed_applications > 0) return series.applications >= options.fixed_applications;
    return options.max_order == 0 && series_continuation_error * series.remainder < options.tolerance;
}

// Lights are the views: M applications give 2 M orders, c_{a+b} = <K^a g_v, K^b g_l>.
OrderSeries symmetric_series(const Series& series, const Fields& g, const SeriesOptions& options,
                             const Monitor& monitor) {
    OrderSeries result;
    const int wanted = options.max_order == 0 ? std::numeric_limits<int>::max() : options.max_order - 1;
    const double albedo = options.largest_albedo, start = sampled_inner_product(g, g);
    std::vector<Fields> carried;  // K g, K^2 g, ...
    auto order = [&](int k) { return k == 0 ? &g : &carried[k - 1]; };
    double weight = 1, last_even = start;  // albedo^M, <K^(M-1) g, K^(M-1) g>
    while (2 * result.applications < wanted && result.applications < options.max_applications) {
        monitor.check_cancelled();
        const Fields& before = *order(result.applications);
        carried.push_back(series.next(before));
        ++result.applications;
        weight *= albedo;
        const double even = sampled_inner_product(carried.back(), carried.back());
        if (!(even > 0)) {
            result.ratio = result.remainder = 0;
            break;
        }
        // From the norms. The products c_{2M} / c_{2M-1} would tell more, but mislead where light bounces
        // between two walls (K has eigenvalues +x and -x, and odd orders nearly vanish). After one
        // application the norm still falls too fast, and they are needed.
        const double by_norm = std::sqrt(even / last_even);
        const double odd = sampled_inner_product(*order(result.applications - 1), carried.back());
        const bool first = result.applications == 1 && odd > 0;
        result.ratio = std::min(first ? std::min(even / odd, 2 * by_norm) : by_norm, largest_ratio);
        last_even = even;
        result.remainder = continuation(weight * weight * even / start, albedo * result.ratio);
        if (enough(result, options)) break;
    }
    const int m = result.applications;
    if (m == 0) return result;

    if (options.combine) {
        // sum_{k=1}^{2M} = <g, S> + <a^M K^M g, S> with S = sum_{k=1}^{M} a^k K^k g.
        Combination sum;
        for (int k = 1; k <= m; ++k) sum.push_back({order(k), std::pow(albedo, k)});
        result.higher.push_back(series.products({{&g, 1}, {order(m), weight}}, sum));
        const double x = albedo * result.ratio;
        if (result.remainder > 0.1 * options.tolerance) {
            const Combination last{{order(m), 1}};
            add_scaled(series.products(last, last), weight * weight * x / (1 - x), result.higher[0]);
        }
        if (options.keep_first) result.first = std::move(carried[0]);
        return result;
    }
    for (int k = 1; k <= std::min(wanted, 2 * m); ++k) {
        const Combination a{{order((k + 1) / 2), 1}}, b{{order(k / 2), 1}};
        result.higher.push_back(series.products(a, k % 2 == 0 ? a : b));
    }
    if (options.max_order != 0) result.ratio = result.remainder = 0;
    if (options.keep_first) result.first = std::move(carried[0]);
    return result;
}

// Different lights and views: transport the smaller set, meet the other one at every order.
OrderSeries one_sided_series(const Series& series, const Fields& lights, const Fields& views,
                             const SeriesOptions& options, const Monitor& monitor) {
    OrderSeries result;
    const int wanted = options.max_order == 0 ? std::numeric_limits<int>::max() : options.max_order - 1;
    const bool from_lights = lights.n_columns() <= views.n_columns();
    const Fields& source = from_lights ? lights : views;
    auto meet = [&](const Combination& carried) {
        return from_lights ? series.products(carried, {{&views, 1}})
                           : series.products({{&lights, 1}}, carried);
    };
    const double albedo = options.largest_albedo, start = sampled_inner_product(source, source);
    std::vector<Fields> carried;  // combined: all of them; else the last one
    double weight = 1, norm = start;
    while (result.applications < wanted && result.applications < 2 * options.max_applications) {
        monitor.check_cancelled();
        Fields next = series.next(carried.empty() ? source : carried.back());
        if (options.keep_first && result.applications == 0) result.first = next;
        if (!options.combine) carried.clear();
        carried.push_back(std::move(next));
        ++result.applications;
        weight *= albedo;
        if (!options.combine) result.higher.push_back(meet({{&carried.back(), 1}}));
        const double next_norm = sampled_inner_product(carried.back(), carried.back());
        if (!(next_norm > 0)) {
            result.ratio = result.remainder = 0;
            break;
        }
        result.ratio = std::min(std::sqrt(next_norm / norm), largest_ratio);
        result.remainder = continuation(weight * std::sqrt(next_norm / start), albedo * result.ratio);
        norm = next_norm;
        if (enough(result, options)) break;
    }
    if (options.max_order != 0) result.ratio = result.remainder = 0;
    if (options.combine && !carried.empty()) {
        Combination sum;
        for (size_t k = 0; k < carried.size(); ++k)
            sum.push_back({&carried[k], std::pow(albedo, static_cast<double>(k + 1))});
        const double x = albedo * result.ratio;
        sum.back().factor *= 1 + x / (1 - x);
        result.higher.push_back(meet(sum));
    }
    return result;
}

}  // namespace

OrderSeries diffuse_series(const LinkOperator& op, const Tile& tile, const Fields& lights,
                           const Fields& views, bool same_directions, const ChannelFactors* factors,
                           const SeriesOptions& options, int n_threads, const Monitor& monitor) {
    const Series series(op, tile, factors, options.average_to, n_threads);
    return same_directions ? symmetric_series(series, lights, options, monitor)
                           : one_sided_series(series, lights, views, options, monitor);
}

}  // namespace gonio
