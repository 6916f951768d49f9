#include "scattering/turned_light.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "visibility/curvature.h"

namespace gonio {
namespace {

// to = sum of factors * fields.
Fields combined(const Combination& terms, int n_threads) {
    Fields to(terms[0].fields->n_unknowns(), terms[0].fields->n_columns());
    constexpr size_t chunk = 1 << 16;
    const size_t size = to.values().size();
    parallel_for(static_cast<int>((size + chunk - 1) / chunk), n_threads, [&](int k) {
        for (size_t i = k * chunk; i < std::min(size, (k + 1) * chunk); ++i) {
            double sum = 0;
            for (const Term& term : terms) sum += term.factor * term.fields->values()[i];
            to.values()[i] = static_cast<float>(sum);
        }
    });
    return to;
}

}  // namespace

double rms_turn(const LinkOperator& op) {
    double sum = 0, total = 0;
    for (const LinkOperator::Chunk& chunk : op.chunks)
        for (size_t k = 0; k < chunk.turns.size(); ++k) {
            const double a = chunk.turns[k].about[0], b = chunk.turns[k].about[1];
            sum += chunk.links[k].weight * (a * a + b * b);
            total += chunk.links[k].weight;
        }
    return total > 0 ? std::sqrt(sum / total) : 0;
}

double turn_step(double rms_turn) {
    return std::clamp(1.5 * rms_turn, 1e-3, 0.3);
}

int turned_coefficients(const BaseCurvature& base) {
    if (!base.is_curved()) return 1;
    return base.kappa_1 != 0 && base.kappa_2 != 0 ? 6 : 3;
}

TurnedLight turned_light(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                         Fields straight, double step, const std::vector<SubSample>& sub_samples,
                         bool skip_steep, int n_threads, const Monitor& monitor) {
    const double c = std::cos(grid.base.direction), s = std::sin(grid.base.direction);
    TurnedLight result;
    auto turned_by = [&](double a, double b) {
        const double turn = std::hypot(a, b);
        std::vector<Vec3> directions;
        for (const Vec3& light : lights)
            directions.push_back(
                turned_direction(light, turn, (c * a - s * b) / turn, (s * a + c * b) / turn));
        LightIrradiance light =
            light_irradiance(grid, tile, directions, sub_samples, skip_steep, n_threads, monitor);
        result.rays += light.rays;
        return std::move(light.lights);
    };
    auto slope = [&](const Fields& up, const Fields& down) {
        return combined({{&up, 0.5 / step}, {&down, -0.5 / step}}, n_threads);
    };
    auto bend = [&](const Fields& up, const Fields& down) {
        const double unit = 0.5 / (step * step);
        return combined({{&up, unit}, {&down, unit}, {&straight, -2 * unit}}, n_threads);
    };
    const bool both = grid.base.kappa_1 != 0 && grid.base.kappa_2 != 0;
    if (!both) {
        result.axis = grid.base.kappa_1 != 0 ? 0 : 1;
        const double a = result.axis == 0 ? step : 0, b = result.axis == 1 ? step : 0;
        const Fields up = turned_by(a, b), down = turned_by(-a, -b);
        Fields t = slope(up, down), tt = bend(up, down);
        result.coefficients.push_back(std::move(straight));
        result.coefficients.push_back(std::move(t));
        result.coefficients.push_back(std::move(tt));
        return result;
    }
    std::vector<Fields> linear, square;
    for (int axis = 0; axis < 2; ++axis) {
        const double a = axis == 0 ? step : 0, b = axis == 1 ? step : 0;
        const Fields up = turned_by(a, b), down = turned_by(-a, -b);
        linear.push_back(slope(up, down));
        square.push_back(bend(up, down));
    }
    const Fields up = turned_by(step, step), down = turned_by(-step, -step), diagonal = bend(up, down);
    Fields mixed = combined({{&diagonal, 1}, {&square[0], -1}, {&square[1], -1}}, n_threads);
    result.coefficients.push_back(std::move(straight));
    for (Fields& f : linear) result.coefficients.push_back(std::move(f));
    result.coefficients.push_back(std::move(square[0]));
    result.coefficients.push_back(std::move(mixed));
    result.coefficients.push_back(std::move(square[1]));
    return result;
}

TurnedLight apply(const LinkOperator& op, const TurnedLight& x, int n_threads) {
    TurnedLight y;
    y.axis = x.axis;
    const int n = static_cast<int>(x.coefficients.size());
    for (const Fields& f : x.coefficients) y.coefficients.emplace_back(f.n_unknowns(), f.n_columns());
    parallel_for(x.coefficients[0].n_blocks(), n_threads, [&](int block) {
        std::vector<const float*> from;
        std::vector<float*> to;
        for (int m = 0; m < n; ++m) {
            from.push_back(x.coefficients[m].block(block));
            to.push_back(y.coefficients[m].block(block));
            std::fill_n(to.back(), y.coefficients[m].n_unknowns() * column_block, 0.0f);
        }
        for (const LinkOperator::Chunk& chunk : op.chunks)
            apply_turned_links(chunk.records.data(), chunk.records.size() - 1, chunk.links.data(),
                               chunk.turns.data(), n, x.axis, from.data(), to.data());
    });
    return y;
}

}  // namespace gonio
