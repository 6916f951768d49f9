#include "scattering/turn_nodes.h"

#include <algorithm>
#include <cmath>

#include "visibility/curvature.h"

namespace gonio {

TurnNodes::TurnNodes(const BaseCurvature& base, double step)
    : base_(base), step_(step), both_(base.kappa_1 != 0 && base.kappa_2 != 0), nodes_{{0, 0}} {
    if (both_)
        for (int k = 0; k < 5; ++k)
            nodes_.push_back({step * std::cos(2 * pi * k / 5), step * std::sin(2 * pi * k / 5)});
    else if (base.kappa_1 != 0)
        nodes_.insert(nodes_.end(), {{step, 0}, {-step, 0}});
    else
        nodes_.insert(nodes_.end(), {{0, step}, {0, -step}});
}

std::vector<Vec3> TurnNodes::turned(const std::vector<Vec3>& lights) const {
    const double c = std::cos(base_.direction), s = std::sin(base_.direction);
    std::vector<Vec3> all = lights;
    for (int m = 1; m < count(); ++m) {
        const auto [a, b] = nodes_[m];
        const double turn = std::hypot(a, b), x = (c * a - s * b) / turn, y = (s * a + c * b) / turn;
        for (const Vec3& light : lights) all.push_back(turned_direction(light, turn, x, y));
    }
    return all;
}

std::array<double, TurnNodes::most> TurnNodes::weights(double t0, double t1) const {
    std::array<double, most> w{};
    // Lagrange's polynomials: in one variable; and on the pentagon by its Fourier modes 0, 1 and 2 in the
    // azimuth, which are all that a polynomial of second degree has there.
    const double square = (t0 * t0 + t1 * t1) / (step_ * step_);
    w[0] = 1 - square;
    for (int m = 1; m < count(); ++m) {
        const double along = (t0 * nodes_[m][0] + t1 * nodes_[m][1]) / (step_ * step_);
        w[m] = both_ ? (2 * along + 4 * along * along - square) / 5 : (along + along * along) / 2;
    }
    return w;
}

void TurnNodes::shift(const LinkTurn& turn, size_t n, float* rows, float* scratch) const {
    // Of a base that is curved along one principal direction, the other one's turn is 0.
    for (int m = 0; m < count(); ++m) {
        const std::array<double, most> w =
            weights(nodes_[m][0] + turn.about[0], nodes_[m][1] + turn.about[1]);
        float* to = scratch + m * n;
        std::fill_n(to, n, 0.0f);
        for (int k = 0; k < count(); ++k) {
            const float factor = static_cast<float>(w[k]);
            for (size_t l = 0; l < n; ++l) to[l] += factor * rows[k * n + l];
        }
    }
    std::copy_n(scratch, count() * n, rows);
}

TurnedLights turned_lights(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                           const TurnNodes& nodes, const std::vector<SubSample>& sub_samples, bool skip_steep,
                           int n_threads, const Monitor& monitor) {
    const std::vector<Vec3> all = nodes.turned(lights);
    TurnedLights result;
    result.directions = DirectionArrays(all);
    for (size_t first = 0; first < sub_samples.size(); first += most_bits) {
        const VisibilityBits bits = find_visibility(
            grid, tile, all,
            {sub_samples.begin() + static_cast<long>(first),
             sub_samples.begin() + static_cast<long>(std::min(sub_samples.size(), first + most_bits))},
            skip_steep, n_threads, monitor);
        result.rays += bits.rays;
        add_cosines(tile, all, bits, 1.0 / static_cast<double>(sub_samples.size()), n_threads,
                    result.visible);
    }
    return result;
}

}  // namespace gonio
