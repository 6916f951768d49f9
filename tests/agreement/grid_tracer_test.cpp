// The grid tracer against closed forms and, hit by hit, against Embree.
#include "visibility/grid_tracer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "scattering/embree_scene.h"
#include "surface/facet_mesh.h"
#include "surface/generate.h"
#include "visibility/march.h"

namespace gonio {
namespace {

struct Traced {
    RayBatch hits, escaped;
    std::vector<int32_t> lost;
};

Traced trace(const TraceGrid& grid, RayBatch rays, int max_steps = 16384) {
    Traced t;
    t.hits.reserve(rays.n);
    t.escaped.reserve(rays.n);
    trace_rays(grid, rays, t.hits, t.escaped, t.lost, max_steps);
    return t;
}

// Rays from random places on random facets, uniform over the hemisphere of the facet.
RayBatch random_rays(const HeightField& surface, const TraceGrid& grid, int n,
                     std::vector<SceneHit>* starts = nullptr) {
    RayBatch rays;
    rays.reserve(n);
    for (int k = 0; k < n; ++k) {
        const auto w = random_words(5, 1, 2 * k), x = random_words(5, 1, 2 * k + 1);
        const int i = static_cast<int>(w[0] % surface.nx), j = static_cast<int>(w[1] % surface.ny),
                  kind = static_cast<int>(w[2] % 2);
        float u = uniform_float(x[0]), v = uniform_float(x[1]);
        if ((kind == 0) != (u >= v)) std::swap(u, v);
        const double z = 2 * uniform_double(x[2]) - 1, phi = 2 * pi * uniform_double(x[3]);
        Vec3 d{std::sqrt(1 - z * z) * std::cos(phi), std::sqrt(1 - z * z) * std::sin(phi), z};
        const Gradient g = facet_gradient(surface, kind, i, j);
        if (d.z - g.x * d.x - g.y * d.y < 0) d = {-d.x, -d.y, -d.z};
        rays.add(grid, i, j, u, v, facet_height(grid, kind, i, j, u, v), d, k);
        if (starts) starts->push_back({i, j, static_cast<int8_t>(kind), u, v});
    }
    return rays;
}

HeightField rough(int nx, int ny, double slope = 0.7, double length_cells = 4) {
    return generate_gaussian(nx, ny, 1e-6, length_cells * 1e-6, slope, 3);
}

// Distance of a place from the edges of its facet, in cells.
double distance_from_edges(int kind, double u, double v) {
    return kind == 0 ? std::min({1 - u, v, u - v}) : std::min({1 - v, u, v - u});
}

// From every facet reflected and other rays; both must meet the same facet but for rays that graze an edge.
void expect_as_embree(const HeightField& surface, int n) {
    SCOPED_TRACE(std::to_string(surface.nx) + " x " + std::to_string(surface.ny));
    const TraceGrid grid = make_trace_grid(surface);
    const EmbreeScene scene(surface);
    std::vector<SceneHit> starts;
    const RayBatch rays = random_rays(surface, grid, n, &starts);
    std::vector<SceneRay> scene_rays(n);
    std::vector<SceneHit> expected(n);
    for (int k = 0; k < n; ++k)
        scene_rays[k] = {scene.surface_point(starts[k]),
                         scene.direction({rays.dx[k], rays.dy[k] / grid.aspect, rays.dz[k]})};
    scene.first_hits(scene_rays, expected);
    const Traced t = trace(grid, rays);
    ASSERT_EQ(t.hits.n + t.escaped.n + t.lost.size(), static_cast<size_t>(n));

    std::vector<int> status(n, -3);
    for (size_t k = 0; k < t.escaped.n; ++k) status[t.escaped.id[k]] = SceneHit::escaped;
    for (const int id : t.lost) status[id] = SceneHit::lost;
    int different = 0, far_off = 0, not_found = 0;
    double squared = 0;
    for (size_t k = 0; k < t.hits.n; ++k) {
        const int id = t.hits.id[k];
        status[id] = t.hits.kind[k];
        const SceneHit& e = expected[id];
        if (e.kind != t.hits.kind[k] || e.i != t.hits.i[k] || e.j != t.hits.j[k]) {
            ++different;
            // The neighbour, by a hair; or the one ray passed an edge that stopped the other.
            far_off += std::min(distance_from_edges(t.hits.kind[k], t.hits.u[k], t.hits.v[k]),
                                e.kind >= 0 ? distance_from_edges(e.kind, e.u, e.v) : 1.0) > 1e-3;
            continue;
        }
        squared += std::pow(e.u - t.hits.u[k], 2) + std::pow(e.v - t.hits.v[k], 2);
        ASSERT_NEAR(facet_height(grid, t.hits.kind[k], t.hits.i[k], t.hits.j[k], t.hits.u[k], t.hits.v[k]),
                    t.hits.z[k], 1e-6 * (1 + std::abs(t.hits.z[k])));
    }
    for (int k = 0; k < n; ++k) not_found += (status[k] < 0) != (expected[k].kind < 0);
    EXPECT_GT(t.hits.n, static_cast<size_t>(n) / 20);
    EXPECT_GT(t.escaped.n, static_cast<size_t>(n) / 20);
    EXPECT_LE(different, 1e-3 * n);
    EXPECT_LE(far_off, 2e-4 * n);
    EXPECT_LE(not_found, 2e-4 * n);
    EXPECT_LE(std::sqrt(squared / static_cast<double>(t.hits.n)), 1e-3);
}

TEST(GridTracer, MeetsTheFacetsThatEmbreeMeets) {
    for (const char* target : {"", "AVX2", "SSE4"}) {
        if (!force_simd_target(target)) continue;
        SCOPED_TRACE(target);
        expect_as_embree(rough(64, 64), 40000);
        expect_as_embree(rough(37, 53, 2.0, 3), 40000);  // nothing divides those
        HeightField oblong = rough(40, 24);
        oblong.pitch_y *= 2.5;
        expect_as_embree(oblong, 40000);
    }
    force_simd_target("");
    expect_as_embree(generate_egg_crate(5, 5e-6, 1e-6), 20000);  // smaller than its jumps
    expect_as_embree(generate_spherical_pits(31, 31e-6, 12e-6, 60), 40000);
}

TEST(GridTracer, TargetsAgree) {
    const HeightField surface = rough(48, 33);
    const TraceGrid grid = make_trace_grid(surface);
    const RayBatch rays = random_rays(surface, grid, 30000);
    const size_t hits = trace(grid, rays).hits.n;
    for (const char* target : {"AVX3", "AVX2", "SSE4"})
        if (force_simd_target(target)) {
            EXPECT_NEAR(static_cast<double>(trace(grid, rays).hits.n), static_cast<double>(hits), 6)
                << target;
        }
    force_simd_target("");
}

// A relief moved by whole cells has the same answers, moved, to the last bit.
TEST(GridTracer, IsExactlyPeriodic) {
    const HeightField surface = rough(37, 20);
    HeightField moved = surface;
    const int shift_i = 11, shift_j = 7;
    for (int j = 0; j < 20; ++j)
        for (int i = 0; i < 37; ++i)
            moved.heights[static_cast<size_t>((j + shift_j) % 20) * 37 + (i + shift_i) % 37] =
                surface.at(i, j);
    const TraceGrid grid = make_trace_grid(surface), moved_grid = make_trace_grid(moved);
    RayBatch rays = random_rays(surface, grid, 10000), moved_rays = rays;
    for (size_t k = 0; k < rays.n; ++k) {
        moved_rays.i[k] = (rays.i[k] + shift_i) % 37;
        moved_rays.j[k] = (rays.j[k] + shift_j) % 20;
    }
    const Traced a = trace(grid, rays), b = trace(moved_grid, moved_rays);
    ASSERT_EQ(a.hits.n, b.hits.n);
    for (size_t k = 0; k < a.hits.n; ++k) {
        ASSERT_EQ(a.hits.id[k], b.hits.id[k]);
        ASSERT_EQ((a.hits.i[k] + shift_i) % 37, b.hits.i[k]);
        ASSERT_EQ((a.hits.j[k] + shift_j) % 20, b.hits.j[k]);
        ASSERT_EQ(a.hits.kind[k], b.hits.kind[k]);
        ASSERT_EQ(a.hits.u[k], b.hits.u[k]);
        ASSERT_EQ(a.hits.v[k], b.hits.v[k]);
        ASSERT_EQ(a.hits.z[k], b.hits.z[k]);
    }
}

TEST(GridTracer, FindsTheOtherWallOfAGroove) {
    // Walls of 45 degrees, period 16 cells, valley at x = 0: a level ray from x on the right wall meets the
    // left one at -x.
    const HeightField surface = generate_v_groove(16, 16e-6, 45);
    const TraceGrid grid = make_trace_grid(surface);
    RayBatch rays;
    rays.reserve(100);
    for (int k = 0; k < 60; ++k) {
        const float x = 0.1f + 0.125f * static_cast<float>(k), u = x - std::floor(x);
        const int i = static_cast<int>(x);
        rays.add(grid, i, 0, u, 0.3f * u, facet_height(grid, 0, i, 0, u, 0.3f * u), {-1, 0, 0}, k);
    }
    const Traced t = trace(grid, rays);
    ASSERT_EQ(t.hits.n, 60u);
    for (size_t k = 0; k < 60; ++k) {
        const float x = 0.1f + 0.125f * static_cast<float>(t.hits.id[k]);
        EXPECT_NEAR(static_cast<float>(t.hits.i[k]) + t.hits.u[k], 16 - x, 2e-5) << x;
    }
}

// From above, across a groove so wide that falling rays jump most of their way. The first crossing by small
// steps in double.
TEST(GridTracer, FallingRaysJumpNoFurtherThanTheyMay) {
    constexpr int period = 128, n = 400;
    const HeightField surface = generate_v_groove(period, period * 1e-6, 10);
    const TraceGrid grid = make_trace_grid(surface);
    const auto height = [&](double x) {  // between the nodes of a groove whose edges lie on nodes
        return grid.lowest + std::tan(radians(10)) * std::abs(x - period * std::round(x / period));
    };
    RayBatch rays;
    rays.reserve(n);
    for (int k = 0; k < n; ++k) {
        const auto w = random_words(6, 2, k);
        const double side = k % 2 ? 1 : -1;
        rays.add(grid, static_cast<int>(w[0] % period), 0, uniform_float(w[1]), 0.3f,
                 grid.highest + uniform_float(w[2]), {side, 0.3, -0.01 - 0.5 * uniform_double(w[3])}, k);
    }
    const RayBatch started = rays;
    const Traced t = trace(grid, rays);
    ASSERT_EQ(t.hits.n, static_cast<size_t>(n));
    for (size_t h = 0; h < t.hits.n; ++h) {
        const int k = t.hits.id[h];
        const double x0 = static_cast<double>(started.i[k]) + started.u[k];
        double travel = 0;
        while (started.z[k] + started.dz[k] * travel > height(x0 + started.dx[k] * travel)) travel += 1e-3;
        const double x = x0 + started.dx[k] * travel, found = static_cast<double>(t.hits.i[h]) + t.hits.u[h];
        EXPECT_NEAR(std::remainder(x - found, period), 0, 0.01) << k;
    }
}

TEST(GridTracer, RaysAlongAxesAndStraightUpAndDown) {
    const HeightField surface = rough(20, 20);
    const TraceGrid grid = make_trace_grid(surface);
    RayBatch rays;
    rays.reserve(64);
    const float above = grid.highest + 1;
    for (int k = 0; k < 20; ++k) rays.add(grid, k, 5, 0.25f, 0.5f, above, {0, 0, -1}, k);
    for (int k = 0; k < 10; ++k)
        rays.add(grid, k, 5, 0.25f, 0.5f, facet_height(grid, 1, k, 5, 0.25f, 0.5f), {0, 0, 1}, 20 + k);
    rays.add(grid, 3, 3, 0.0f, 0.0f, above, {1, 1, -0.5}, 30);  // along the diagonal, through nodes
    rays.add(grid, 3, 3, 0.0f, 0.0f, above, {0, -1, -0.5}, 31);
    const Traced t = trace(grid, rays);
    EXPECT_EQ(t.escaped.n, 10u);
    ASSERT_EQ(t.hits.n, 22u);
    for (size_t k = 0; k < t.hits.n; ++k) {
        if (t.hits.id[k] < 20) {
            EXPECT_EQ(t.hits.i[k], t.hits.id[k]);
            EXPECT_EQ(t.hits.kind[k], 1);
            EXPECT_NEAR(t.hits.u[k], 0.25, 1e-5);
            EXPECT_NEAR(t.hits.v[k], 0.5, 1e-5);
        }
    }
}

TEST(GridTracer, GivesUpRaysThatNeverEndAndSaysWhich) {
    // Along the groove at half depth nothing is ever met.
    const HeightField surface = generate_v_groove(16, 16e-6, 45);
    const TraceGrid grid = make_trace_grid(surface);
    RayBatch rays;
    rays.reserve(3);
    rays.add(grid, 0, 0, 0.5f, 0.25f, 0.5f * (grid.lowest + grid.highest), {0, 1, 0}, 7);
    rays.add(grid, 0, 0, 0.5f, 0.25f, 0.5f * (grid.lowest + grid.highest), {0, 1, 1}, 8);
    rays.add(grid, 0, 0, 0.5f, 0.25f, 0.5f * (grid.lowest + grid.highest), {0, 1, -1}, 9);
    const Traced t = trace(grid, rays, 1000);
    EXPECT_EQ(t.lost, std::vector<int32_t>{7});
    EXPECT_EQ(t.escaped.n, 1u);
    EXPECT_EQ(t.hits.n, 1u);
}

}  // namespace
}  // namespace gonio
