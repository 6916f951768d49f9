// Forward tracing into cells: closed forms, energy, and agreement with photons on Embree.
#include "scattering/forward.h"

#include <gtest/gtest.h>

#include <cmath>

#include "agreement/measured.h"
#include "agreement/photons.h"
#include "base/error.h"
#include "material/facet_brdf.h"
#include "measure/brdf.h"
#include "measure/reference.h"
#include "surface/generate.h"
#include "validation/statistics.h"

namespace gonio {
namespace {

Material mirror(std::vector<double> reflectance, std::vector<std::string> channels) {
    return {std::move(channels), Mirror{{reflectance, {}, {}}}};
}
Material perfect_mirror() {
    return mirror({1}, {"y"});
}

BrdfPlan cell_plan(std::vector<ReceiverCell> cells, std::vector<AnglesDeg> incident, int sub_samples = 1,
                   int runs = 6) {
    BrdfPlan plan;
    plan.incident = std::move(incident);
    plan.outgoing = centres(cells);
    plan.outgoing_cells = std::move(cells);
    plan.transport = TransportKind::forward;
    plan.accuracy.samples = Accuracy::Samples{sub_samples, 64, 1, runs};
    return plan;
}

const std::vector<AnglesDeg> lights{{0, 0}, {20, 30}, {45, 200}, {60, 100}, {75, 310}};

HeightField rough(int nx = 64, int ny = 48) {
    return generate_gaussian(nx, ny, 1e-6, 6e-6, 0.7, 4);
}

// What leaves into all cells, relative to what comes in.
double leaving(const Table& table, size_t channel, size_t slice, size_t light) {
    double sum = 0;
    for (size_t cell = 0; cell < table.cells.size(); ++cell)
        sum += table.f[table.index(channel, slice, light * table.cells.size() + cell)] *
               projected_solid_angle(table.cells[cell]);
    return sum;
}

TEST(Forward, AFlatMirrorSendsAllIntoOneCell) {
    const HeightField plane = generate_plane(8, 1e-6);
    const std::vector<ReceiverCell> cells = klems_full_cells();
    const Table table = measure_brdf(plane, mirror({0.25, 1}, {"r", "g"}),
                                     cell_plan(cells, {{0, 0}, {31, 77}, {72, 200}}), {})
                            .table;
    const CellLocator locator(cells);
    for (size_t l = 0; l < table.incident.size(); ++l) {
        const Vec3 d = to_vector(table.incident[l]);
        const int mirrored = locator(-d.x, -d.y);
        for (size_t cell = 0; cell < cells.size(); ++cell)
            for (size_t c = 0; c < 2; ++c) {
                const double expected = static_cast<int>(cell) == mirrored
                                            ? (c == 0 ? 0.25 : 1.0) / projected_solid_angle(cells[cell])
                                            : 0;
                const size_t k = table.index(c, 0, l * cells.size() + cell);
                EXPECT_NEAR(table.f[k], expected, 1e-6 * expected);
                EXPECT_NEAR(table.se[k], 0, 1e-6 * expected + 1e-12);
            }
    }
}

// Walls of 30 degrees from straight above: each lit once, its light leaves at 60 degrees without meeting the
// other wall.
TEST(Forward, AGrooveOfMirrorsSplitsTheLight) {
    const HeightField groove = generate_v_groove(16, 16e-6, 30);
    const std::vector<ReceiverCell> cells = klems_full_cells();
    const Table table = measure_brdf(groove, perfect_mirror(), cell_plan(cells, {{0, 0}}), {}).table;
    const CellLocator locator(cells);
    const double sine = std::sin(radians(60));
    for (const double side : {-1.0, 1.0})
        EXPECT_NEAR(table.f[locator(side * sine, 0)] * projected_solid_angle(cells[locator(side * sine, 0)]),
                    0.5, 1e-5);
    EXPECT_NEAR(leaving(table, 0, 0, 0), 1, 1e-5);
}

// At 50 degrees the mirrored light meets the other wall: cos 100 deg is below the horizon. It leaves after
// the second reflection, at 180 - 4 * 50 = -20 degrees from the vertical.
TEST(Forward, ASteepGrooveOfMirrorsReturnsTheLightAfterTwo) {
    const HeightField groove = generate_v_groove(64, 64e-6, 50);
    BrdfPlan plan = cell_plan(equal_cells(400), {{0, 0}});
    plan.separate_orders = true;
    plan.max_order = 3;
    const Table table = measure_brdf(groove, perfect_mirror(), plan, {}).table;
    const CellLocator locator(table.cells);
    const double sine = std::sin(radians(20));
    EXPECT_NEAR(leaving(table, 0, 1, 0), 0, 1e-6);
    EXPECT_NEAR(leaving(table, 0, 2, 0), 1, 1e-5);
    double there = 0;
    for (const double side : {-1.0, 1.0}) {
        const int cell = locator(side * sine, 0);
        there += table.f[table.index(0, 2, cell)] * projected_solid_angle(table.cells[cell]);
    }
    // On the border of two sectors (azimuths 0 and 180 are bounds), so part of it may lie beyond that border.
    EXPECT_GT(there, 0.2);
}

TEST(Forward, EnergyOfAPerfectMirrorIsExact) {
    for (const HeightField& surface : {rough(), rough(37, 29)}) {
        BrdfPlan plan = cell_plan(equal_cells(64), lights);
        const BrdfResult result = measure_brdf(surface, perfect_mirror(), plan, {});
        for (size_t l = 0; l < lights.size(); ++l) EXPECT_NEAR(leaving(result.table, 0, 0, l), 1, 1e-5) << l;
    }
}

// A constant reflectance multiplies each order by its power.
TEST(Forward, ReflectanceIsRaisedToTheOrder) {
    BrdfPlan plan = cell_plan(equal_cells(30), lights);
    plan.separate_orders = true;
    const Table table = measure_brdf(rough(), mirror({1, 0.5}, {"r", "g"}), plan, {}).table;
    ASSERT_GE(table.orders, 3);
    double total = 0;
    for (int order = 1; order <= table.orders; ++order)
        for (size_t row = 0; row < table.rows(); ++row) {
            const double whole = table.f[table.index(0, order, row)];
            EXPECT_NEAR(table.f[table.index(1, order, row)], whole * std::pow(0.5, order), 1e-5 * whole);
            total += order > 1 ? whole : 0;
        }
    EXPECT_GT(total, 0);
}

TEST(Forward, OrdersAddUpAndALimitLeavesOutTheRest) {
    BrdfPlan plan = cell_plan(equal_cells(30), lights);
    plan.separate_orders = true;
    const Table all = measure_brdf(rough(), perfect_mirror(), plan, {}).table;
    plan.max_order = 2;
    const Table two = measure_brdf(rough(), perfect_mirror(), plan, {}).table;
    ASSERT_EQ(two.orders, 2);
    for (size_t row = 0; row < all.rows(); ++row) {
        double sum = 0;
        for (int order = 1; order <= all.orders; ++order) sum += all.f[all.index(0, order, row)];
        // Orders beyond those of the first run are in the sum alone.
        EXPECT_GE(all.f[all.index(0, 0, row)], sum * (1 - 1e-6));
        EXPECT_NEAR(all.f[all.index(0, 0, row)], sum, 1e-4 * (1 + sum));
        for (int order = 1; order <= 2; ++order)
            EXPECT_FLOAT_EQ(two.f[two.index(0, order, row)], all.f[all.index(0, order, row)]);
        EXPECT_NEAR(two.f[two.index(0, 0, row)], two.f[two.index(0, 1, row)] + two.f[two.index(0, 2, row)],
                    1e-5 * (1 + sum));
    }
}

TEST(Forward, AgreesWithPhotonsOnEmbree) {
    HeightField surface = rough();
    surface.pitch_y *= 1.4;
    const std::vector<ReceiverCell> cells = equal_cells(64);
    BrdfPlan plan = cell_plan(cells, lights, 4, 8);
    plan.separate_orders = true;
    plan.max_order = 4;
    const Table table = measure_brdf(surface, perfect_mirror(), plan, {}).table;
    const PhotonTracer photons(surface, cells);
    // Independent sets of photons tell their own error.
    constexpr int sets = 8, strata = 160;
    std::vector<double> deviations;
    double most = 0;
    for (size_t l = 0; l < lights.size(); ++l) {
        std::vector<Photons> found;
        for (int s = 0; s < sets; ++s)
            found.push_back(photons.trace(to_vector(lights[l]), strata, 100 * l + s, 4));
        for (int order = 1; order <= 2; ++order)
            for (size_t cell = 0; cell < cells.size(); ++cell) {
                double mean = 0, squares = 0;
                for (const Photons& p : found) mean += p.share[order - 1][cell] / sets;
                for (const Photons& p : found) squares += std::pow(p.share[order - 1][cell] - mean, 2);
                const double sr = projected_solid_angle(cells[cell]);
                const size_t k = table.index(0, order, l * cells.size() + cell);
                const double sigma = std::hypot(std::sqrt(squares / (sets * (sets - 1))) / sr, table.se[k]);
                if (mean * strata * strata < 50) continue;  // too few photons for their spread to be known
                deviations.push_back((table.f[k] - mean / sr) / sigma);
                most = std::max(most, std::abs(deviations.back()));
            }
    }
    ASSERT_GT(deviations.size(), 200u);
    // Student's t of 7 degrees of freedom: variance 7 / 5.
    EXPECT_NEAR(reference::rms(deviations), 1.1, 0.25);
    EXPECT_LT(most, 6.5);
}

Material mixed() {
    Material material;
    material.channels = {"r", "g"};
    material.lobes = {
        {0.3, Lambertian{{0.9, 0.4}}},
        {{0.3, 0.5}, Microfacet{Microfacet::Distribution::ggx, 0.3, 0.2, 30.0, {{1.0}, {}, {}}}},
        {0.2, Mirror{{{0.8, 1.0}, {}, {}}}}};
    return material;
}

// Mean of f over a cell, weighted by the cosine, from n x n directions in it.
template <class Value>
double mean_over(const ReceiverCell& cell, int n, Value&& f) {
    double sum = 0;
    for (int a = 0; a < n; ++a)
        for (int b = 0; b < n; ++b) sum += f(direction_in(cell, (a + 0.5) / n, (b + 0.5) / n)) / (n * n);
    return sum;
}

// On a plane f is that of the facet, the mirror's share in the one cell that holds the mirrored direction.
TEST(Forward, OnAPlaneCellsHoldTheMeanOfTheMaterial) {
    const HeightField plane = generate_plane(64, 1e-6);
    const std::vector<ReceiverCell> cells = equal_cells(40);
    const Material material = mixed();
    const Table table = measure_brdf(plane, material, cell_plan(cells, {{40, 25}}, 64, 8), {}).table;
    const FacetBrdf brdf(material, plane, 0, 0, 0);
    const Vec3 wi = to_vector({40, 25});
    const int mirrored = CellLocator(cells)(-wi.x, -wi.y);
    const double weight[2] = {0.2 * 0.8, 0.2 * 1.0};
    for (size_t c = 0; c < 2; ++c)
        for (size_t cell = 0; cell < cells.size(); ++cell) {
            double expected = mean_over(cells[cell], 24, [&](const Vec3& wo) {
                double f[2];
                brdf.eval(wi, wo, f);
                return f[c];
            });
            if (static_cast<int>(cell) == mirrored)
                expected += weight[c] / projected_solid_angle(cells[cell]);
            const size_t k = table.index(c, 0, cell);
            // 1e-3: of the quadrature over the cell.
            EXPECT_NEAR(table.f[k], expected, 4.5 * table.se[k] + 1e-3 * expected) << c << " " << cell;
            EXPECT_LT(table.se[k], 0.05 * expected);
        }
}

// Glossy facets of a relief, all orders: the mean over directions in a cell by the path tracer.
TEST(Forward, AgreesWithThePathTracerOnGlossyFacets) {
    const HeightField surface = rough(32, 32);
    Material material = mixed();
    material.lobes.pop_back();
    const std::vector<ReceiverCell> cells = equal_cells(12);
    const BrdfPlan plan = cell_plan(cells, {{50, 25}}, 16, 8);
    const Table table = measure_brdf(surface, material, plan, {}).table;
    BrdfPlan directions;
    directions.incident = plan.incident;
    constexpr int n = 5;
    for (const ReceiverCell& cell : cells)
        mean_over(cell, n, [&](const Vec3& d) {
            directions.outgoing.push_back({degrees(std::acos(d.z)), degrees(std::atan2(d.y, d.x))});
            return 0;
        });
    const Table traced = measure_reference(surface, material, directions, {1024}, {}).table;
    for (size_t c = 0; c < 2; ++c)
        for (size_t cell = 0; cell < cells.size(); ++cell) {
            double mean = 0, variance = 0;
            for (size_t k = 0; k < n * n; ++k) {
                mean += traced.f[traced.index(c, 0, cell * n * n + k)] / (n * n);
                variance += std::pow(traced.se[traced.index(c, 0, cell * n * n + k)] / (n * n), 2);
            }
            const size_t k = table.index(c, 0, cell);
            // 1 %: of the quadrature over these large cells.
            EXPECT_NEAR(table.f[k], mean, 4 * std::hypot(table.se[k], std::sqrt(variance)) + 0.01 * mean)
                << c << " " << cell;
        }
}

TEST(Forward, SameBitsOnAnyNumberOfThreads) {
    BrdfPlan plan = cell_plan(equal_cells(20), lights);
    RunOptions options;
    const Table one = measure_brdf(rough(), perfect_mirror(), plan, options).table;
    options.n_threads = 3;
    const Table three = measure_brdf(rough(), perfect_mirror(), plan, options).table;
    EXPECT_EQ(one.f, three.f);
    EXPECT_EQ(one.se, three.se);
}

// Where hardly a ray ends, runs that all found nothing agree with each other and are still wrong: the error
// says so.
TEST(Forward, CellsThatFewRaysReachAreNotSureToBeDark) {
    const HeightField groove = generate_v_groove(16, 16e-6, 45);
    const Material paint{{"y"}, Lambertian{0.8}};
    BrdfPlan plan = cell_plan(equal_cells(12), {{20, 30}, {62, 205}}, 4, 12);
    plan.separate_orders = true;
    plan.max_order = 3;
    const Table few = measure_brdf(groove, paint, plan, {}).table;
    plan.accuracy.samples = Accuracy::Samples{1024, 64, 1, 12};
    plan.accuracy.seed = 2;
    const Table many = measure_brdf(groove, paint, plan, {}).table;
    int empty = 0;
    for (size_t k = 0; k < few.f.size(); ++k) {
        empty += few.f[k] == 0 && many.f[k] > 0;
        EXPECT_NEAR(few.f[k], many.f[k], 4.5 * std::hypot(few.se[k], many.se[k])) << k;
    }
    EXPECT_GT(empty, 0);
}

// One run over perfect mirrors, and what leaves of its light.
struct MirrorRun {
    ForwardTally tally;
    double leaving = 0;
};
MirrorRun trace_mirrors(const HeightField& surface, const AnglesDeg& light) {
    const std::vector<ReceiverCell> cells = equal_cells(30);
    const Material material = perfect_mirror();
    const MarchGrid march = make_march_grid(surface);
    const ForwardScene scene(surface, march, material, cells);
    ForwardSettings settings;
    settings.sub_samples = {{0.3, 0.8}};
    MirrorRun run{trace_light(scene, to_vector(light), settings, 1, 1, 0, {})};
    for (const std::vector<double>& order : run.tally.share)
        for (const double share : order) run.leaving += share;
    return run;
}

// Light that is still to and fro between two mirrors after the last order is no loss: it is left over, and
// the table's bias holds it.
TEST(Forward, WhatIsStillInsideIsSaid) {
    const HeightField slot = generate_v_groove(8, 8e-6, 88.8);  // back up after 75 reflections
    const MirrorRun run = trace_mirrors(slot, {0, 0});
    const double remainder = run.tally.remainder[0];
    EXPECT_GT(remainder, 0.1);
    EXPECT_NEAR(run.leaving + remainder, 1, 1e-5);

    const Table table = measure_brdf(slot, perfect_mirror(), cell_plan(equal_cells(30), {{0, 0}}), {}).table;
    const float least = *std::min_element(table.bias.begin(), table.bias.end());
    EXPECT_GT(least * pi, 0.5 * remainder);
}

// So are rays that run along below the top of the relief without ever meeting it.
TEST(Forward, RaysGivenUpAreLeftOver) {
    HeightField post = generate_plane(8, 1e-6);
    post.heights[3 * 8 + 3] = 1e-6F;
    const MirrorRun run = trace_mirrors(post, {89.99999, 0});
    EXPECT_GT(run.tally.rays_lost, 0);
    EXPECT_GT(run.tally.remainder[0], 0.01);
    EXPECT_NEAR(run.leaving + run.tally.remainder[0], 1, 1e-5);
}

// Large reliefs are started from some of their blocks: those of all phases together are the whole.
TEST(Forward, BlocksAddUpToTheWhole) {
    const HeightField surface = rough(96, 96);
    const MarchGrid march = make_march_grid(surface);
    const std::vector<ReceiverCell> cells = equal_cells(20);
    const Material material = perfect_mirror();
    const ForwardScene scene(surface, march, material, cells);
    const Vec3 light = to_vector({55, 20});
    ForwardSettings settings;
    settings.sub_samples = {{0.3, 0.8}};
    const ForwardTally whole = trace_light(scene, light, settings, 1, 1, 0, {});
    std::vector<double> sum(cells.size(), 0.0);
    settings.block_step = 3;
    for (settings.first_block = 0; settings.first_block < 3; ++settings.first_block) {
        const ForwardTally part = trace_light(scene, light, settings, 1, 1, 0, {});
        EXPECT_LT(part.rays, 0.5 * whole.rays);
        for (size_t cell = 0; cell < cells.size(); ++cell)
            sum[cell] += part.share[0][cell] * part.projected / 3;
    }
    for (size_t cell = 0; cell < cells.size(); ++cell)
        EXPECT_NEAR(sum[cell], whole.share[0][cell] * whole.projected, 1e-6);
}

// Every other block of 32 x 32 cells is flat, the others are grooved: runs that start from half of the blocks
// see all of them in turn.
TEST(Forward, RunsTakeTurnsInTheBlocks) {
    constexpr int nx = 512, ny = 256;
    std::vector<double> heights;
    for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i)
            heights.push_back(i / 32 % 2 == 0 ? 0.0 : 0.3 * std::abs(i % 8 - 4) - 1.2);
    heights[5 * nx + 5] = 1e-3;  // no row is another's image
    BrdfPlan plan = cell_plan({{0, 20, -180, 180}, {20, 90, -180, 180}}, {{0, 0}});
    plan.accuracy.samples.reset();
    plan.accuracy.target_relative_error = 0.8;
    const BrdfResult result =
        measure_brdf(make_height_field(nx, ny, 1, 1, heights), perfect_mirror(), plan, {});
    ASSERT_TRUE(was_skipped(result.report, "most facets as starting points"));
    const double back = result.table.f[0] * projected_solid_angle(result.table.cells[0]);
    EXPECT_NEAR(back, 0.5, 0.3);
}

// A relief of one column is simulated with its axes exchanged: what leaves must come back to where it
// belongs.
TEST(Forward, ReliefsOfOneRowAndOneColumnAreEachOthersImage) {
    const HeightField row = generate_v_groove(16, 16e-6, 40);
    HeightField column = row;
    column.nx = 1, column.ny = row.nx;
    const std::vector<ReceiverCell> cells = klems_full_cells();
    const Table a = measure_brdf(row, perfect_mirror(), cell_plan(cells, {{20, 10}}), {}).table;
    const Table b = measure_brdf(column, perfect_mirror(), cell_plan(cells, {{20, 80}}), {}).table;
    const CellLocator locator(cells);
    for (size_t cell = 0; cell < cells.size(); ++cell) {
        const Vec3 d = direction_in(cells[cell], 0.4, 0.4);
        EXPECT_NEAR(a.f[cell], b.f[locator(d.y, d.x)], 0.02 * (a.f[cell] + 0.1)) << cell;
    }
}

// With its own target: reaches it, says so, and errs by about what it says.
TEST(Forward, ReachesATargetAndItsErrorsAreHonest) {
    const HeightField surface = rough();
    BrdfPlan plan = cell_plan(equal_cells(16), lights);
    plan.accuracy.samples.reset();
    plan.accuracy.target_relative_error = 0.02;
    const BrdfResult result = measure_brdf(surface, perfect_mirror(), plan, {});
    EXPECT_TRUE(result.report.target_met);
    EXPECT_LE(result.report.relative_error, 0.02);
    plan.accuracy.target_relative_error.reset();
    plan.accuracy.samples = Accuracy::Samples{64, 64, 1, 6};
    plan.accuracy.seed = 2;
    const Table truth = measure_brdf(surface, perfect_mirror(), plan, {}).table;
    std::vector<double> deviations;
    for (size_t k = 0; k < truth.f.size(); ++k)
        if (result.table.se[k] > 0)
            deviations.push_back((result.table.f[k] - truth.f[k]) /
                                 std::hypot(result.table.se[k], result.table.bias[k]));
    ASSERT_GT(deviations.size(), 60u);
    EXPECT_GT(reference::rms(deviations), 0.6);
    EXPECT_LT(reference::rms(deviations), 1.5);
}

TEST(Forward, RefusesWhatItCannotAnswer) {
    const auto field_of = [](const Material& material, const BrdfPlan& plan) {
        try {
            measure_brdf(generate_egg_crate(8, 8e-6, 1e-6), material, plan, {});
        } catch (const Error& error) {
            return error.field();
        }
        return std::string("accepted");
    };
    BrdfPlan directions;
    directions.incident = directions.outgoing = lights;
    EXPECT_EQ(field_of(perfect_mirror(), directions), "/measure/outgoing");
    directions.transport = TransportKind::forward;
    const Material matte{{"y"}, Lambertian{0.5}};
    EXPECT_EQ(field_of(matte, directions), "/measure/transport");
    BrdfPlan cells = cell_plan(equal_cells(4), lights);
    for (const TransportKind kind : {TransportKind::pair_graph, TransportKind::diffuse}) {
        cells.transport = kind;
        EXPECT_EQ(field_of(perfect_mirror(), cells), "/measure/transport");
    }
}

}  // namespace
}  // namespace gonio
