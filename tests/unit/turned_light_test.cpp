// Light that turns from point to point: the polynomial against lights that are really turned, and its
// transport against sums in double, link by link.
#include "scattering/turned_light.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scattering/turn_nodes.h"
#include "scattering/turned_radiosity.h"
#include "surface/generate.h"
#include "visibility/curvature.h"

namespace gonio {
namespace {

class TurnedLightOn : public ::testing::TestWithParam<BaseCurvature> {
  protected:
    TurnedLightOn() {
        surface.base = GetParam();
        grid = make_march_grid(surface);
        tile = make_tile(surface, {0, 0, 32, 24}, {0, 0, 32, 24}, 1);
    }
    Fields irradiance(const std::vector<Vec3>& directions) const {
        return light_irradiance(grid, tile, directions, places, true, 1, {}).lights;
    }
    TurnedLight polynomial() const {
        return turned_light(grid, tile, lights, irradiance(lights), step, places, true, 1, {});
    }

    HeightField surface = generate_gaussian(32, 24, 1, 4, 0.7, 6);
    MarchGrid grid;
    Tile tile;
    const std::vector<Vec3> lights{to_vector({20, 40}), to_vector({60, 250}), to_vector({75, 130})};
    const std::vector<SubSample> places{{0.3, 0.6}, {0.8, 0.1}};
    const double step = 0.05;
};

// Powers of the turns that the coefficients stand beside.
std::vector<double> powers(const TurnedLight& light, double a, double b) {
    if (light.coefficients.size() == 6) return {1, a, b, a * a, a * b, b * b};
    const double t = light.axis == 0 ? a : b;
    return {1, t, t * t};
}

TEST_P(TurnedLightOn, GoesThroughTheTurnedLights) {
    const TurnedLight light = polynomial();
    const bool both = surface.base.kappa_1 != 0 && surface.base.kappa_2 != 0;
    ASSERT_EQ(light.coefficients.size(), both ? 6u : 3u);
    EXPECT_GT(light.rays, 0);
    auto turned_by = [&](double a, double b) {
        const double turn = std::hypot(a, b), c = std::cos(surface.base.direction),
                     s = std::sin(surface.base.direction);
        std::vector<Vec3> turned = lights;
        if (turn > 0)
            for (Vec3& d : turned)
                d = turned_direction(d, turn, (c * a - s * b) / turn, (s * a + c * b) / turn);
        return irradiance(turned);
    };
    auto error_at = [&](double a, double b, const Fields& expected) {
        const std::vector<double> p = powers(light, a, b);
        std::vector<double> errors(expected.values().size());
        for (size_t k = 0; k < errors.size(); ++k) {
            for (size_t m = 0; m < p.size(); ++m) errors[k] += p[m] * light.coefficients[m].values()[k];
            errors[k] -= expected.values()[k];
        }
        return errors;
    };
    const double x = both || light.axis == 0 ? step : 0, y = both || light.axis == 1 ? step : 0;
    for (const auto& [a, b] : {std::pair{0.0, 0.0}, {x, 0.0}, {-x, 0.0}, {0.0, y}, {0.0, -y}})
        for (const double error : error_at(a, b, turned_by(a, b))) ASSERT_NEAR(error, 0, 2e-6);
    // Both turns together: the mean of forth and back, which is what the mixed coefficient adds.
    const std::vector<double> forth = error_at(x, y, turned_by(x, y)),
                              back = error_at(-x, -y, turned_by(-x, -y));
    for (size_t k = 0; k < forth.size(); ++k) ASSERT_NEAR(forth[k] + back[k], 0, 4e-6);
}

TEST_P(TurnedLightOn, IsCarriedLinkByLink) {
    const TurnedLight light = polynomial();
    const double slope = grid.max_slope;
    const DirectionSet set = slab_directions(24, slope / std::sqrt(1 + slope * slope), 0.3, 0.7);
    std::vector<SubSample> jitter;
    for (int i = 0; i < 24; ++i) jitter.push_back({fractional_part(0.37 * i), fractional_part(0.61 * i)});
    const LinkOperator op = build_link_operator(grid, tile, set, jitter, 1, {});
    ASSERT_GT(op.links, 1000);
    EXPECT_GT(rms_turn(op), 0);
    const TurnedLight carried = apply(op, light, 1);
    // x(t + a, t' + b) at any (t, t'), from its coefficients.
    auto value = [&](const TurnedLight& x, size_t at, double a, double b) {
        const std::vector<double> p = powers(x, a, b);
        double sum = 0;
        for (size_t m = 0; m < p.size(); ++m) sum += p[m] * x.coefficients[m].values()[at];
        return sum;
    };
    for (const auto& [a, b] : {std::pair{0.0, 0.0}, {0.03, -0.02}}) {
        std::vector<double> expected(light.coefficients[0].values().size(), 0.0);
        for (const LinkOperator::Chunk& chunk : op.chunks)
            for (size_t r = 0; r + 1 < chunk.records.size(); ++r)
                for (uint32_t k = chunk.records[r].begin; k < chunk.records[r + 1].begin; ++k)
                    for (int c = 0; c < 3; ++c) {
                        const size_t p = static_cast<size_t>(chunk.records[r].unknown) * column_block + c,
                                     q = static_cast<size_t>(chunk.links[k].seen) * column_block + c;
                        const double t = chunk.turns[k].about[0], u = chunk.turns[k].about[1],
                                     w = chunk.links[k].weight;
                        expected[p] += w * value(light, q, a + t, b + u);
                        expected[q] += w * value(light, p, a - t, b - u);
                    }
        for (size_t k = 0; k < expected.size(); ++k)
            ASSERT_NEAR(value(carried, k, a, b), expected[k], 1e-5 + 1e-5 * std::abs(expected[k])) << k;
    }
}

// What facets send back in all: first, second and third order, by two operators in turn.
TEST_P(TurnedLightOn, IsSummedOverTheOrders) {
    const TurnedLight light = polynomial();
    std::array<LinkOperator, 2> operators;
    for (int k = 0; k < 2; ++k) {
        const double slope = grid.max_slope;
        std::vector<SubSample> jitter(16, {0.4, 0.3});
        operators[k] = build_link_operator(
            grid, tile, slab_directions(16, slope / std::sqrt(1 + slope * slope), 0.3, 0.2 + 0.4 * k), jitter,
            1, {});
    }
    const TurnedLight second = apply(operators[0], light, 1), third = apply(operators[1], second, 1);
    // The light here is scaled by sqrt(area) already.
    TurnedLight per_area = light;
    std::vector<float> inverse(tile.n_slots());
    for (size_t k = 0; k < inverse.size(); ++k)
        inverse[k] = tile.sqrt_area[k] > 0 ? 1 / tile.sqrt_area[k] : 0;
    for (Fields& f : per_area.coefficients) scale_rows(f, tile, inverse, 1);
    RadiosityOptions options;
    options.max_order = 3;
    FacetAlbedo constant, map;
    constant.constant = {0.5, 0.8};
    map.maps = {std::vector<float>(tile.n_slots(), 0.8f)};
    TurnedRadiosity of_constant, of_map;
    turned_radiosity(operators, tile, constant, options, per_area, 1, {}, of_constant);
    turned_radiosity(operators, tile, map, options, per_area, 1, {}, of_map);
    ASSERT_EQ(of_constant.of_channel.size(), 2u);
    EXPECT_EQ(of_constant.applications, 2);
    double turns = 0;
    for (size_t k = 0; k < light.coefficients[0].values().size(); ++k) {
        const double root = inverse[k / column_block % tile.n_slots()];
        auto expected = [&](double a) {
            return root * a *
                   (light.coefficients[0].values()[k] + a * second.coefficients[0].values()[k] +
                    a * a * third.coefficients[0].values()[k]);
        };
        ASSERT_NEAR(of_constant.of_channel[0].values()[k], expected(0.5), 2e-5);
        ASSERT_NEAR(of_constant.of_channel[1].values()[k], expected(0.8), 2e-5);
        ASSERT_NEAR(of_map.of_channel[0].values()[k], expected(0.8), 2e-5);
        turns = std::max(turns, std::abs(static_cast<double>(second.coefficients[1].values()[k])));
    }
    EXPECT_GT(turns, 0.01);
}

INSTANTIATE_TEST_SUITE_P(Bases, TurnedLightOn,
                         ::testing::Values(BaseCurvature{0.02, 0, 0.3}, BaseCurvature{0, -0.01, 0},
                                           BaseCurvature{0.02, 0.01, 0.3}));

// On a cylinder the turn along a link is the curvature times the way across; twice the curvature turns twice
// as far.
TEST(LinkTurns, GrowWithTheCurvature) {
    auto turn = [](double kappa) {
        HeightField surface = generate_gaussian(32, 32, 1, 4, 0.7, 6);
        surface.base = {kappa, 0, 0};
        const MarchGrid grid = make_march_grid(surface);
        const Tile tile = make_tile(surface, {0, 0, 32, 32}, {0, 0, 32, 32}, 1);
        std::vector<SubSample> jitter(32, {0.4, 0.3});
        return rms_turn(build_link_operator(grid, tile, slab_directions(32, 0.8, 0.1, 0.2), jitter, 1, {}));
    };
    EXPECT_NEAR(turn(2e-6) / turn(1e-6), 2, 0.05);
}

// Polynomials of second degree go from their values at the nodes to those where the light has turned, and
// node m's light is the light turned by it.
TEST_P(TurnedLightOn, NodesCarryPolynomials) {
    const TurnNodes nodes(GetParam(), 0.1);
    const bool both = GetParam().kappa_1 != 0 && GetParam().kappa_2 != 0;
    ASSERT_EQ(nodes.count(), both ? 6 : 3);
    const LinkTurn turn{{GetParam().kappa_1 != 0 ? 0.07f : 0.0f, GetParam().kappa_2 != 0 ? -0.16f : 0.0f}};
    auto value = [&](double a, double b, int column) {
        const double x = a + b * 0.3;
        return 1 + column + 3 * a - 2 * b + 5 * x * x - column * a * b + 4 * b * b;
    };
    std::vector<float> rows, expected, scratch;
    for (const auto& [a, b] : nodes.turns())
        for (int column = 0; column < 5; ++column) {
            rows.push_back(static_cast<float>(value(a, b, column)));
            expected.push_back(static_cast<float>(value(a + turn.about[0], b + turn.about[1], column)));
        }
    scratch.resize(rows.size());
    nodes.shift(turn, 5, rows.data(), scratch.data());
    for (size_t k = 0; k < rows.size(); ++k) EXPECT_NEAR(rows[k], expected[k], 1e-5) << k;

    const std::vector<Vec3> lamps{to_vector({30, 40}), to_vector({70, 200})}, turned = nodes.turned(lamps);
    const double c = std::cos(GetParam().direction), s = std::sin(GetParam().direction);
    for (int m = 0; m < nodes.count(); ++m) {
        // At the base offset where the frame has turned so.
        const double x = both || GetParam().kappa_1 != 0 ? nodes.turns()[m][0] / GetParam().kappa_1 : 0,
                     y = both || GetParam().kappa_2 != 0 ? nodes.turns()[m][1] / GetParam().kappa_2 : 0;
        for (size_t l = 0; l < lamps.size(); ++l) {
            const Vec3 there = turned_direction(lamps[l], GetParam(), c * x - s * y, s * x + c * y);
            EXPECT_NEAR(dot(turned[m * lamps.size() + l], there), 1, 1e-12);
        }
    }
}

}  // namespace
}  // namespace gonio
