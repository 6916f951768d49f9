#include "measure/accuracy.h"

#include <algorithm>
#include <cmath>

namespace gonio {

void Moments::add(const std::vector<float>& values) {
    if (count_ == 0) {
        mean_.assign(values.size(), 0.0);
        squares_.assign(values.size(), 0.0);
    }
    ++count_;
    for (size_t i = 0; i < values.size(); ++i) {
        const double d = values[i] - mean_[i];
        mean_[i] += d / count_;
        squares_[i] += d * (values[i] - mean_[i]);
    }
}

double student_one_sigma(double degrees_of_freedom) {
    // Fit to the exact quantiles (1.837, 1.321, 1.197, 1.111, 1.077, 1.047 at 1, 2, 3, 5, 7, 11), within 0.5
    // % from 3 up.
    const double d = std::max(1.0, degrees_of_freedom);
    return 1 + 0.52 / d + 0.18 / (d * d) + 0.137 / (d * d * d);
}

std::vector<double> error_scale(const std::vector<double>& f) {
    double mean = 0;
    for (const double v : f) mean += std::abs(v) / static_cast<double>(f.size());
    std::vector<double> scale(f.size());
    for (size_t i = 0; i < f.size(); ++i) scale[i] = std::max(std::abs(f[i]), 0.01 * mean);
    return scale;
}

std::vector<double> standard_errors(const Moments& moments, size_t first, const RowGroups& groups) {
    const size_t n = groups.light.size();
    const int runs = moments.count();
    const std::vector<double> f(moments.mean().begin() + static_cast<long>(first),
                                moments.mean().begin() + static_cast<long>(first + n));
    const std::vector<double> scale = error_scale(f);

    std::vector<double> of_light(groups.n_lights, 0.0), of_view(groups.n_views, 0.0);
    std::vector<int> rows_of_light(groups.n_lights, 0), rows_of_view(groups.n_views, 0);
    double all = 0;
    for (size_t r = 0; r < n; ++r) {
        if (!(scale[r] > 0)) continue;
        const double relative = moments.variance(first + r) / (scale[r] * scale[r]);
        of_light[groups.light[r]] += relative;
        of_view[groups.view[r]] += relative;
        ++rows_of_light[groups.light[r]];
        ++rows_of_view[groups.view[r]];
        all += relative;
    }
    all /= static_cast<double>(n);
    // A light or view of few rows is itself drawn towards the whole table: with one row it would predict only
    // itself. Not where rows are many: the table's mean is that of a heavy-tailed set, and most rows would
    // get too much.
    auto factor = [&](double sum, int n_rows) {
        const double prior = std::max(0.0, 2.5 - 0.5 * n_rows);  // rows
        return (sum + prior * all) / (n_rows + prior);
    };
    // What the prediction is worth: 1.5 runs in a table, nothing for a lone value. Not more: all values of a
    // run share its shifts, so the level of the whole table's variance is no better known than from `runs`
    // runs, whatever the number of rows.
    const double prior_freedom = std::min(1.5, 0.5 * static_cast<double>(n - 1)),
                 freedom = runs - 1 + prior_freedom;
    const double t = student_one_sigma(freedom);
    std::vector<double> se(n, 0.0);
    for (size_t r = 0; r < n; ++r) {
        if (!(scale[r] > 0) || !(all > 0)) continue;
        const int l = groups.light[r], v = groups.view[r];
        const double light_factor = factor(of_light[l], rows_of_light[l]),
                     view_factor = factor(of_view[v], rows_of_view[v]);
        const double predicted = light_factor * view_factor / all * scale[r] * scale[r];
        const double variance =
            ((runs - 1) * moments.variance(first + r) + prior_freedom * predicted) / freedom;
        se[r] = t * std::sqrt(variance / runs);
    }
    return se;
}

}  // namespace gonio
