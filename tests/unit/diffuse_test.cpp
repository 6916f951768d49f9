// The diffuse transport: identities that hold to rounding for every relief and any number of directions.
#include "scattering/diffuse.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "surface/generate.h"
#include "visibility/march.h"

namespace gonio {
namespace {

HeightField white_noise(int nx, int ny, double amplitude) {
    std::mt19937 random(9);
    std::uniform_real_distribution<double> uniform(0, amplitude);
    std::vector<double> heights(static_cast<size_t>(nx) * ny);
    for (double& h : heights) h = uniform(random);
    return make_height_field(nx, ny, 1, 1, heights);
}

std::vector<SubSample> places(int n) {
    std::vector<SubSample> list;
    for (int k = 0; k < n; ++k)
        list.push_back({fractional_part(0.3 + k * 0.7549), fractional_part(0.8 + k * 0.5698)});
    return list;
}

std::vector<Vec3> vectors(const std::vector<AnglesDeg>& angles) {
    std::vector<Vec3> list;
    for (const AnglesDeg& a : angles) list.push_back(to_vector(a));
    return list;
}

const std::vector<AnglesDeg> some_lights = {{0, 0}, {25, 40}, {50, 130}, {65, 250}, {80, 10}, {85, 190}};
const std::vector<AnglesDeg> other_views = {{10, 300}, {45, 200}, {70, 60}, {60, 90}, {83, 333}};

double value(const Fields& f, size_t unknown, int column) {
    return f.block(column / column_block)[unknown * column_block + column % column_block];
}
void set(Fields& f, size_t unknown, int column, double v) {
    f.block(column / column_block)[unknown * column_block + column % column_block] = static_cast<float>(v);
}

double inner(const Fields& a, int i, const Fields& b, int j) {
    double sum = 0;
    for (size_t u = 0; u < a.n_unknowns(); ++u) sum += value(a, u, i) * value(b, u, j);
    return sum;
}

Fields zeros(size_t n_unknowns, int n_columns) {
    Fields f(n_unknowns, n_columns);
    std::fill(f.values().begin(), f.values().end(), 0.0f);
    return f;
}

Fields noise(size_t n_unknowns, int n_columns, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Fields f = zeros(n_unknowns, n_columns);
    for (int c = 0; c < n_columns; ++c)
        for (size_t u = 0; u < n_unknowns; ++u) set(f, u, c, uniform(random));
    return f;
}

// One relief with its operator and the irradiance of both sets of directions.
struct Scene {
    HeightField surface;
    MarchGrid grid;
    Tile tile;
    LinkOperator op;
    Irradiance same, sides;  // lights seen from the lights; lights and other views

    Scene(HeightField s, int refinement, int n_directions, int n_sub_samples = 1)
        : surface(std::move(s)),
          grid(make_march_grid(surface)),
          tile(make_tile(surface, {0, 0, surface.nx, surface.ny}, {0, 0, surface.nx, surface.ny},
                         refinement)) {
        const double z_max = grid.max_slope / std::hypot(1, grid.max_slope);
        op = build_link_operator(grid, tile, slab_directions(n_directions, z_max, 0.3, 0.6),
                                 places(n_directions), 1, {});
        const std::vector<Vec3> lights = vectors(some_lights), views = vectors(other_views);
        same = compute_irradiance(grid, tile, lights, lights, true, places(n_sub_samples), {}, true, 1, {});
        sides = compute_irradiance(grid, tile, lights, views, false, places(n_sub_samples), {}, true, 1, {});
    }
    Fields scaled_one() const {  // the irradiance 1 everywhere, in the basis scaled by sqrt(area)
        Fields one = zeros(tile.n_unknowns(), 1);
        for (size_t u = 0; u < tile.n_unknowns(); ++u) set(one, u, 0, tile.sqrt_area[u % tile.n_slots()]);
        return one;
    }
    OrderSeries symmetric(const SeriesOptions& options) const {
        return diffuse_series(op, tile, same.lights, same.view_fields(), true, nullptr, options, 1, {});
    }
    OrderSeries one_sided(const SeriesOptions& options) const {
        return diffuse_series(op, tile, sides.lights, sides.views, false, nullptr, options, 1, {});
    }
};

std::vector<std::pair<std::string, HeightField>> reliefs() {
    return {{"white noise", white_noise(64, 64, 1.5)},
            {"V-groove", generate_v_groove(32, 1, 70)},
            {"pits", generate_spherical_pits(48, 1, 0.38, 90)},
            {"Gaussian", generate_gaussian(64, 64, 1, 5, 1.4, 3)}};
}

void expect_matrices_near(const Matrix& a, const Matrix& b, double relative, bool transposed = false) {
    ASSERT_EQ(a.rows, transposed ? b.columns : b.rows);
    ASSERT_EQ(a.columns, transposed ? b.rows : b.columns);
    double largest = 0;
    for (const double v : a.values) largest = std::max(largest, std::abs(v));
    for (int i = 0; i < a.rows; ++i)
        for (int j = 0; j < a.columns; ++j) {
            const double other = transposed ? b(j, i) : b(i, j);
            EXPECT_NEAR(a(i, j), other, relative * (std::abs(other) + 1e-3 * largest)) << i << ", " << j;
        }
}

TEST(LinkOperator, IsSelfAdjoint) {
    for (const auto& [name, surface] : reliefs())
        for (const int refinement : {1, 2}) {
            const Scene scene(surface, refinement, 48);
            const Fields x = noise(scene.tile.n_unknowns(), 40, 1);  // a full and a partial block
            Fields y = zeros(x.n_unknowns(), 40);
            apply(scene.op, x, y, 1);
            const double scale = std::sqrt(inner(x, 0, x, 0) * inner(y, 0, y, 0));
            for (const auto& [i, j] : {std::pair{0, 1}, {3, 17}, {31, 32}, {39, 5}})
                EXPECT_NEAR(inner(x, i, y, j), inner(x, j, y, i), 1e-6 * scale) << name;
            Fields threads = zeros(x.n_unknowns(), 40);
            apply(scene.op, x, threads, 3);
            for (size_t k = 0; k < y.values().size(); ++k) ASSERT_EQ(y.values()[k], threads.values()[k]);
        }
}

// The walls of a groove of opening angle 2 b exchange 1 - sin(b) of their light (Hottel's crossed strings).
TEST(LinkOperator, ExchangesTheFormFactorOfAGroove) {
    for (const double slope_deg : {20.0, 45.0, 70.0}) {
        const Scene scene(generate_v_groove(32, 1, slope_deg), 1, 4096);
        const Fields one = scene.scaled_one();
        Fields seen = zeros(one.n_unknowns(), 1);
        apply(scene.op, one, seen, 1);
        const double exact = 1 - std::cos(radians(slope_deg));
        EXPECT_NEAR(inner(one, 0, seen, 0) / inner(one, 0, one, 0), exact, 1e-3 * exact) << slope_deg;
    }
}

TEST(LinkOperator, PlaneHasNoLinks) {
    const Scene scene(generate_plane(5, 1), 1, 16);
    EXPECT_EQ(scene.op.links, 0);
}

// Albedo 1 loses nothing: with e = sqrt(area) (1 - K 1) what each facet sends to the sky, all orders together
// send <e, sum K^k g> = <sqrt(area), g>, the light that arrived; K must be self-adjoint for that, not exact.
TEST(Diffuse, WhiteFurnace) {
    for (const auto& [name, surface] : reliefs()) {
        const Scene scene(surface, 1, 64);
        const Fields one = scene.scaled_one();
        const size_t n = one.n_unknowns();
        Fields e = zeros(n, 1);
        apply(scene.op, one, e, 1);
        for (size_t u = 0; u < n; ++u) set(e, u, 0, value(one, u, 0) - value(e, u, 0));
        const int n_lights = scene.same.lights.n_columns();
        Fields carried = scene.same.lights, next = zeros(n, n_lights);
        std::vector<double> sent(n_lights, 0.0), left(n_lights), arrived(n_lights);
        for (int c = 0; c < n_lights; ++c) arrived[c] = inner(one, 0, carried, c);
        for (int k = 0; k < 2000; ++k) {
            double most = 0;
            for (int c = 0; c < n_lights; ++c) {
                sent[c] += inner(e, 0, carried, c);
                left[c] = inner(one, 0, carried, c) / arrived[c];
                most = std::max(most, left[c]);
            }
            if (most < 1e-8) break;
            apply(scene.op, carried, next, 1);
            std::swap(carried, next);
        }
        for (int c = 0; c < n_lights; ++c) {
            EXPECT_LT(left[c], 1e-8) << name << ": the series has not ended";
            EXPECT_NEAR(sent[c] / arrived[c], 1, 1e-6) << name << ", light " << c;
            // What tables are normalised by.
            EXPECT_NEAR(scene.same.projected_lights[c] / arrived[c], 1, 1e-6) << name << ", light " << c;
        }
    }
}

TEST(Diffuse, IsReciprocalToRounding) {
    for (const auto& [name, surface] : reliefs())
        for (const int refinement : {1, 2}) {
            SCOPED_TRACE(name);
            const Scene scene(surface, refinement, 32);
            SeriesOptions options;
            options.fixed_applications = 6;
            options.keep_orders = true;
            const OrderSeries forth = scene.one_sided(options);
            const OrderSeries back = diffuse_series(scene.op, scene.tile, scene.sides.views,
                                                    scene.sides.lights, false, nullptr, options, 1, {});
            ASSERT_EQ(forth.orders.size(), back.orders.size());
            for (size_t k = 0; k < forth.orders.size(); ++k)
                expect_matrices_near(forth.orders[k], back.orders[k], 1e-6, true);
            const OrderSeries symmetric = scene.symmetric(options);
            for (const Matrix& order : symmetric.orders) expect_matrices_near(order, order, 1e-6, true);
            expect_matrices_near(scene.same.direct[0], scene.same.direct[0], 1e-6, true);
        }
}

TEST(Diffuse, SymmetricSeriesEqualsOneSided) {
    for (const auto& [name, surface] : reliefs()) {
        SCOPED_TRACE(name);
        const Scene scene(surface, 1, 32, 2);
        SeriesOptions options;
        options.keep_orders = true;
        options.fixed_applications = 4;
        const OrderSeries symmetric = scene.symmetric(options);
        options.fixed_applications = 8;
        const OrderSeries one_sided = diffuse_series(scene.op, scene.tile, scene.same.lights,
                                                     scene.same.lights, false, nullptr, options, 1, {});
        ASSERT_EQ(symmetric.orders.size(), 8u);
        ASSERT_EQ(one_sided.orders.size(), 8u);
        for (size_t k = 0; k < 8; ++k) expect_matrices_near(symmetric.orders[k], one_sided.orders[k], 2e-6);
        // After as many applications both see the same ratio from order to order.
        options.fixed_applications = 4;
        const OrderSeries shorter = diffuse_series(scene.op, scene.tile, scene.same.lights, scene.same.lights,
                                                   false, nullptr, options, 1, {});
        EXPECT_NEAR(symmetric.ratio, shorter.ratio, 1e-4);
        EXPECT_LT(symmetric.ratio, 0.95);
    }
}

// Orders kept apart and summed, or summed at once; one albedo at a time, or all from one run.
TEST(Diffuse, SumsAreTheSameHoweverTheyAreMade) {
    const Scene scene(generate_gaussian(64, 48, 1, 4, 1.2, 5), 1, 48);
    const std::vector<double> albedos = {0.2, 0.5, 0.9, 1.0};
    for (const bool symmetric : {true, false}) {
        auto series = [&](const SeriesOptions& options) {
            return symmetric ? scene.symmetric(options) : scene.one_sided(options);
        };
        SeriesOptions options;
        options.tolerance = 1e-7;
        options.keep_orders = true;
        options.albedos = albedos;
        const OrderSeries apart = series(options);
        ASSERT_EQ(apart.sums.size(), albedos.size());
        options.keep_orders = false;
        const OrderSeries together = series(options);
        EXPECT_TRUE(together.orders.empty());
        for (size_t a = 0; a < albedos.size(); ++a) {
            SCOPED_TRACE(testing::Message() << (symmetric ? "symmetric" : "one-sided") << ", " << albedos[a]);
            expect_matrices_near(apart.sums[a], together.sums[a], 0);
            SeriesOptions one = options;
            one.albedos = {albedos[a]};
            const OrderSeries alone = series(one);
            EXPECT_TRUE(alone.orders.empty());
            ASSERT_EQ(alone.sums.size(), 1u);
            expect_matrices_near(alone.sums[0], apart.sums[a], 3e-6);
            one.keep_orders = true;
            expect_matrices_near(alone.sums[0], series(one).sums[0], 3e-6);
        }
    }
}

// sum over k >= 1 of K^k, as far as it goes.
Matrix plain_sum(const Scene& scene) {
    SeriesOptions options;
    options.max_order = 120;
    options.keep_orders = true;
    return scene.symmetric(options).sums[0];
}

double rms_error(const Scene& scene, const Matrix& sum, const Matrix& truth) {
    double error = 0, direct = 0;
    for (size_t k = 0; k < truth.values.size(); ++k) {
        error += std::pow(sum.values[k] - truth.values[k], 2);
        direct += std::pow(scene.same.direct[0].values[k], 2);
    }
    return std::sqrt(error / direct);
}

// Few applications must do as well as they say, also where all light bounces between two walls (K has the
// eigenvalues +x and -x).
TEST(Diffuse, RemainderIsTheErrorOfTheSums) {
    const std::pair<const char*, HeightField> cases[] = {
        {"rough", generate_gaussian(64, 48, 1, 4, 1.2, 5)},
        {"gentle", generate_gaussian(64, 48, 1, 8, 0.4, 6)},
        {"groove", generate_rectangular_groove(64, 64, 32, 40)}};
    for (const auto& [name, surface] : cases) {
        const Scene scene(surface, 1, 48);
        const Matrix truth = plain_sum(scene);
        for (const int applications : {1, 2, 3, 4, 6}) {
            SeriesOptions options;
            options.fixed_applications = applications;
            const OrderSeries few = scene.symmetric(options);
            const double error = rms_error(scene, few.sums[0], truth);
            // Rounding of float fields ends what can be seen.
            EXPECT_LT(error, std::max(2 * few.remainder, 1e-6)) << name << ", " << applications;
            EXPECT_GT(error, few.remainder / 40 - 1e-6) << name << ", " << applications;
        }
    }
}

TEST(Diffuse, ConstantMapEqualsConstantAlbedo) {
    const Scene scene(generate_gaussian(48, 48, 1, 4, 1.2, 5), 2, 32);
    const double albedo = 0.6;
    const ChannelFactors factors(scene.tile.n_slots(), static_cast<float>(std::sqrt(albedo)));
    SeriesOptions options;
    options.keep_orders = true;
    options.fixed_applications = 4;
    for (const bool symmetric : {true, false}) {
        Fields lights = symmetric ? scene.same.lights : scene.sides.lights,
               views = symmetric ? scene.same.lights : scene.sides.views;
        scale_rows(lights, scene.tile, factors, 1);
        scale_rows(views, scene.tile, factors, 2);
        for (size_t u = 0; u < lights.n_unknowns(); u += 97)
            EXPECT_FLOAT_EQ(static_cast<float>(value(lights, u, 1)),
                            factors[0] * static_cast<float>(value(
                                             symmetric ? scene.same.lights : scene.sides.lights, u, 1)));
        const OrderSeries map =
            diffuse_series(scene.op, scene.tile, lights, views, symmetric, &factors, options, 1, {});
        const OrderSeries plain = symmetric ? scene.symmetric(options) : scene.one_sided(options);
        ASSERT_EQ(map.orders.size(), plain.orders.size());
        for (size_t k = 0; k < plain.orders.size(); ++k) {
            Matrix expected = plain.orders[k];
            for (double& v : expected.values) v *= std::pow(albedo, static_cast<double>(k + 2));
            expect_matrices_near(map.orders[k], expected, 3e-6);
        }
    }
}

// Each row of the table must carry its own factor, parts of a facet the same one.
TEST(Diffuse, ScaleRowsMultipliesEveryPart) {
    const HeightField surface = white_noise(33, 5, 1);
    const Tile tile = make_tile(surface, {0, 0, 33, 5}, {0, 0, 33, 5}, 2);
    ChannelFactors factors(tile.n_slots());
    for (size_t s = 0; s < factors.size(); ++s) factors[s] = 0.1f + static_cast<float>(s % 7);
    const Fields before = noise(tile.n_unknowns(), 35, 3);
    Fields after = before;
    scale_rows(after, tile, factors, 2);
    for (size_t u = 0; u < tile.n_unknowns(); ++u)
        for (const int c : {0, 31, 34})
            EXPECT_FLOAT_EQ(static_cast<float>(value(after, u, c)),
                            factors[u % tile.n_slots()] * static_cast<float>(value(before, u, c)));
}

TEST(Diffuse, MaxOrderTruncates) {
    const Scene scene(generate_gaussian(48, 48, 1, 4, 1.2, 5), 1, 32);
    SeriesOptions options;
    options.keep_orders = true;
    options.fixed_applications = 6;
    for (const bool symmetric : {true, false}) {
        const OrderSeries all = symmetric ? scene.symmetric(options) : scene.one_sided(options);
        for (const int order : {1, 2, 3, 4, 5}) {
            SeriesOptions truncated;
            truncated.max_order = order;
            truncated.keep_orders = true;
            const OrderSeries some = symmetric ? scene.symmetric(truncated) : scene.one_sided(truncated);
            ASSERT_EQ(some.orders.size(), static_cast<size_t>(order - 1));
            EXPECT_EQ(some.ratio, 0);
            EXPECT_EQ(some.remainder, 0);
            for (int k = 0; k + 1 < order; ++k) expect_matrices_near(some.orders[k], all.orders[k], 1e-7);
        }
    }
}

// A relief whose slopes lie in a few rows alone must not look black to whoever judges when the series may
// end.
TEST(Diffuse, SeriesSeesReliefWhereverItLies) {
    for (const int at : {0, 20, 40, 100}) {
        std::vector<double> heights(128 * 128, 0.0);
        for (int j = at; j < at + 12; ++j)
            for (int i = 30; i < 60; ++i) heights[j * 128 + i] = -20;
        const Scene scene(make_height_field(128, 128, 1, 1, heights), 1, 48);
        SeriesOptions options;
        options.tolerance = 1e-4;
        const OrderSeries series = scene.symmetric(options);
        EXPECT_GT(series.applications, 4) << "pit at row " << at;
        EXPECT_GT(series.ratio, 0.3);
        options.fixed_applications = 40;
        const OrderSeries long_one = scene.symmetric(options);
        const Matrix &got = series.sums[0], &expected = long_one.sums[0];
        EXPECT_GT(expected(0, 0), 100 * options.tolerance * scene.same.direct[0](0, 0));
        EXPECT_NEAR(got(0, 0), expected(0, 0), options.tolerance * scene.same.direct[0](0, 0)) << at;
    }
}

TEST(Fields, AveragePartsIsAProjection) {
    const HeightField surface = white_noise(33, 6, 1);
    const Tile tile = make_tile(surface, {0, 0, 33, 6}, {0, 0, 33, 6}, 4);
    const Fields x = noise(tile.n_unknowns(), 34, 1), y = noise(tile.n_unknowns(), 34, 2);
    for (const int coarse : {1, 2, 4}) {
        Fields px = x, py = y;
        average_parts(tile, coarse, 1, px);
        average_parts(tile, coarse, 2, py);
        Fields ppx = px;
        average_parts(tile, coarse, 1, ppx);
        for (size_t k = 0; k < px.values().size(); ++k) ASSERT_NEAR(px.values()[k], ppx.values()[k], 1e-6);
        EXPECT_NEAR(inner(px, 3, y, 33), inner(x, 3, py, 33), 1e-4);
        EXPECT_NEAR(inner(px, 3, y, 33), inner(px, 3, py, 33), 1e-4);
        // As many values a facet as the coarse refinement has parts, and their sum is kept.
        for (const size_t slot : {size_t{0}, size_t{40}, tile.n_slots() - 32}) {
            std::vector<float> distinct;
            double sum = 0, expected = 0;
            for (int part = 0; part < 16; ++part) {
                const size_t u = part * tile.n_slots() + slot;
                distinct.push_back(static_cast<float>(value(px, u, 5)));
                sum += value(px, u, 5);
                expected += value(x, u, 5);
            }
            EXPECT_NEAR(sum, expected, 1e-5);
            std::sort(distinct.begin(), distinct.end());
            const auto end = std::unique(distinct.begin(), distinct.end());
            EXPECT_EQ(end - distinct.begin(), coarse * coarse);
        }
    }
}

TEST(Fields, AddProductsEqualsADoubleLoopOverTheCore) {
    const HeightField surface = white_noise(80, 50, 1);
    for (const int refinement : {1, 2})
        for (const auto& [area, core] : {std::pair{CellRect{70, 45, 60, 30}, CellRect{9, 4, 33, 20}},
                                         {CellRect{0, 0, 80, 50}, CellRect{0, 0, 80, 50}},
                                         {CellRect{0, 0, 40, 50}, CellRect{0, 3, 40, 7}}}) {
            const Tile tile = make_tile(surface, area, core, refinement);
            const Fields a = noise(tile.n_unknowns(), 35, 1), b = noise(tile.n_unknowns(), 3, 2),
                         c = noise(tile.n_unknowns(), 3, 4);
            Fields a0 = a, b0 = b, c0 = c;  // nothing in the padding, as everywhere
            for (Fields* f : {&a0, &b0, &c0})
                for (size_t u = 0; u < tile.n_unknowns(); ++u)
                    if (tile.sqrt_area[u % tile.n_slots()] == 0)
                        for (int k = 0; k < f->n_columns(); ++k) set(*f, u, k, 0);
            Matrix sum(35, 3), threads(35, 3), own(3, 3);
            sum(1, 1) = threads(1, 1) = 5;
            add_products(tile, {{&a0, 1}}, {{&b0, 0.5}, {&c0, -2}}, 3, 1, sum);
            add_products(tile, {{&a0, 1}}, {{&b0, 0.5}, {&c0, -2}}, 3, 2, threads);
            EXPECT_EQ(sum.values, threads.values);
            const Combination itself{{&b0, 1}};
            add_products(tile, itself, itself, 1, 1, own);
            // A single product left out would be about 1.
            const double rounding = 1e-6 * static_cast<double>(tile.n_unknowns());
            for (int i = 0; i < 35; ++i)
                for (int j = 0; j < 3; ++j) {
                    double expected = i == 1 && j == 1 ? 5 : 0, squares = 0;
                    for (int part = 0; part < tile.n_parts(); ++part)
                        for (int kind = 0; kind < 2; ++kind)
                            for (int row = core.y0; row < core.y0 + core.height; ++row)
                                for (int column = core.x0; column < core.x0 + core.width; ++column) {
                                    const size_t u = part * tile.n_slots() + tile.slot(kind, row, column);
                                    expected +=
                                        3 * value(a0, u, i) * (0.5 * value(b0, u, j) - 2 * value(c0, u, j));
                                    if (i < 3) squares += value(b0, u, i) * value(b0, u, j);
                                }
                    EXPECT_NEAR(sum(i, j), expected, rounding);
                    if (i < 3) {
                        EXPECT_NEAR(own(i, j), squares, rounding);
                    }
                }
        }
}

// What arrives is what the period projects towards the light: exact in the mean over all places in a facet.
TEST(Irradiance, ProjectedAreaIsTheCosine) {
    for (const auto& [name, surface] : reliefs()) {
        const Scene scene(surface, 1, 8, 49);
        for (size_t l = 0; l < some_lights.size(); ++l) {
            const double expected = scene.tile.core_area() * std::cos(radians(some_lights[l].theta_deg));
            EXPECT_NEAR(scene.same.projected_lights[l], expected, 0.02 * expected)
                << name << " at " << some_lights[l].theta_deg;
        }
    }
}

// Light and view together: never more than either sees, and all of it where they are one direction.
TEST(Irradiance, DirectTermIsCorrelatedVisibility) {
    const Scene scene(generate_gaussian(48, 48, 1, 4, 1.2, 5), 1, 8, 8);
    const Matrix& direct = scene.same.direct[0];
    for (int l = 0; l < direct.rows; ++l) {
        // <g, g> of averaged visibilities is at most the mean of the squares.
        EXPECT_GE(direct(l, l), inner(scene.same.lights, l, scene.same.lights, l) * (1 - 1e-5));
        for (int v = 0; v < direct.columns; ++v) {
            EXPECT_GE(direct(l, v), 0);
            EXPECT_LE(direct(l, v) * direct(l, v), direct(l, l) * direct(v, v) * (1 + 1e-5));
        }
    }
}

}  // namespace
}  // namespace gonio
