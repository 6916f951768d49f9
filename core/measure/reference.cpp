#include "measure/reference.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string>

#include "base/parallel.h"
#include "measure/shard_bytes.h"
#include "scattering/path_tracer.h"

namespace gonio {
namespace {

// CPU seconds of the process: wall clock says little on a shared machine.
double cpu_seconds() {
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

// The pairs that one bundle of paths serves: of a view all lights, or of a light all cells.
struct Bundle {
    int start = 0;  // number of the view or light
    std::vector<size_t> rows;
    std::vector<Vec3> lights;
    std::vector<ReceiverCell> cells;
};

std::vector<Bundle> bundles_of(const Table& table) {
    const bool into_cells = !table.cells.empty();
    std::vector<Bundle> bundles((into_cells ? table.incident : table.outgoing).size());
    for (size_t k = 0; k < bundles.size(); ++k) bundles[k].start = static_cast<int>(k);
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        Bundle& bundle = bundles[into_cells ? i : o];
        bundle.rows.push_back(row);
        if (into_cells)
            bundle.cells.push_back(table.cells[o]);
        else
            bundle.lights.push_back(to_vector(table.incident[i]));
    }
    std::erase_if(bundles, [](const Bundle& bundle) { return bundle.rows.empty(); });
    return bundles;
}

PathTally trace(const PathTracer& tracer, const Table& table, const Bundle& bundle, int block,
                const Monitor& monitor) {
    const AnglesDeg& start = (table.cells.empty() ? table.outgoing : table.incident)[bundle.start];
    return table.cells.empty()
               ? tracer.trace(bundle.start, to_vector(start), bundle.lights, block, monitor)
               : tracer.trace_into_cells(bundle.start, to_vector(start), bundle.cells, block, monitor);
}

bool has_mirror(const Material& material) {
    return std::any_of(material.lobes.begin(), material.lobes.end(),
                       [](const WeightedLobe& part) { return std::holds_alternative<Mirror>(part.lobe); });
}

double rms_relative_error(const Table& table) {
    double mean = 0, sum = 0;
    size_t n = 0;
    for (size_t c = 0; c < table.channels.size(); ++c)
        for (size_t row = 0; row < table.rows(); ++row, ++n) mean += table.f[table.index(c, 0, row)];
    mean /= static_cast<double>(n);
    for (size_t c = 0; c < table.channels.size(); ++c)
        for (size_t row = 0; row < table.rows(); ++row) {
            const size_t k = table.index(c, 0, row);
            const double floor = std::max<double>(table.f[k], 0.01 * mean);
            if (floor > 0) sum += (table.se[k] / floor) * (table.se[k] / floor);
        }
    return std::sqrt(sum / static_cast<double>(n));
}

}  // namespace

BrdfResult measure_reference(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                             const ReferenceOptions& reference, const RunOptions& options,
                             const Monitor& monitor) {
    validate(material, surface.nx, surface.ny);
    if (plan.outgoing_cells.empty() && has_mirror(material))
        throw Error(
            ErrorCode::invalid_input, "/measure/outgoing", "directions",
            R"(mirrors need receivers of finite size: {"cells": "klems_full"} or {"cells": {"equal": 64}})");
    if (surface.base.is_curved())
        throw Error(ErrorCode::invalid_input, "/base", "",
                    "the path tracer's periodic scene has a flat base only");
    if (reference.paths < 1)
        throw Error(ErrorCode::invalid_input, "paths", std::to_string(reference.paths), "at least 1");
    if (plan.separate_orders && plan.max_order < 1)
        throw Error(ErrorCode::invalid_input, "/measure/max_order", "all",
                    "separate orders need a number of orders");
    const long long scene_bytes = EmbreeScene::estimated_bytes(surface);
    if (scene_bytes > options.max_bytes)
        throw Error(ErrorCode::limit, "/surface",
                    std::to_string(surface.nx) + " x " + std::to_string(surface.ny),
                    "the path tracer needs about " + std::to_string(scene_bytes >> 20) + " MiB for it");

    BrdfResult result;
    Table& table = result.table;
    table.incident = plan.incident;
    table.outgoing = plan.outgoing;
    table.cells = plan.outgoing_cells;
    table.pairs = plan.pairs;
    table.channels = material.channels;
    table.orders = plan.separate_orders ? plan.max_order : 0;
    const size_t n_channels = table.channels.size(), n_slices = table.slices();
    const size_t n_values = n_channels * n_slices;
    table.f.resize(n_values * table.rows());
    table.se.resize(table.f.size());
    // Zero, for the paths are unbiased. It would hold what rounding does to rays within 1e-6 of an edge
    // (`lost` counts a part).
    table.bias.resize(table.f.size());

    monitor.report({0, "building the scene", 0});
    const double start = cpu_seconds();
    const PathTracer tracer(
        surface, material,
        {reference.paths, plan.max_order, table.orders, plan.accuracy.seed, options.allow_skips});
    const double built = cpu_seconds();

    const double scale = tracer.scale();
    RayCounts rays;
    const std::vector<Bundle> bundles = bundles_of(table);
    auto write = [&](const Bundle& bundle, const PathTally& total) {
        rays += total.rays;
        for (size_t l = 0; l < bundle.rows.size(); ++l)
            for (size_t slice = 0; slice < n_slices; ++slice)
                for (size_t c = 0; c < n_channels; ++c) {
                    const size_t from = (l * n_slices + slice) * n_channels + c;
                    const size_t to = table.index(c, slice, bundle.rows[l]);
                    table.f[to] = static_cast<float>(scale * total.sum[from]);
                    table.se[to] = static_cast<float>(scale * std::sqrt(total.squared_spread[from]));
                }
    };
    // A bundle is a shard.
    Shards shards(options.checkpoints, options.shard_task);
    std::vector<std::string> keys;
    for (size_t v = 0; v < bundles.size(); ++v) keys.push_back("view" + std::to_string(v));
    const Shards::Batch batch = shards.take(std::move(keys));
    for (size_t v = 0; v < bundles.size(); ++v)
        if (batch.saved[v]) write(bundles[v], path_tally_from(*batch.saved[v]));

    // Work in waves of (bundle, block) tasks, small enough for the memory and for frequent progress. The sums
    // are added in the order of the tasks, so neither the size of a wave nor the number of threads shows in
    // the bits.
    size_t most_rows = 1;
    for (const Bundle& bundle : bundles) most_rows = std::max(most_rows, bundle.rows.size());
    const long long tally_bytes = static_cast<long long>(most_rows * n_values * 2 * sizeof(double));
    const long long by_memory = std::max(1LL, (options.max_bytes - scene_bytes) / 4 / tally_bytes);
    const long long blocks = tracer.blocks(),
                    n_tasks = blocks * static_cast<long long>(batch.to_compute.size());
    const long long wave = std::min<long long>(by_memory, 4LL * std::max(1, options.n_threads));
    PathTally total;
    std::vector<PathTally> tallies(std::min(wave, n_tasks));
    for (long long first = 0; first < n_tasks; first += wave) {
        monitor.report({static_cast<double>(first) / static_cast<double>(n_tasks), "path tracing", 0});
        const int n = static_cast<int>(std::min(wave, n_tasks - first));
        parallel_for(n, options.n_threads, [&](int k) {
            tallies[k] = trace(tracer, table, bundles[batch.to_compute[(first + k) / blocks]],
                               static_cast<int>((first + k) % blocks), monitor);
        });
        for (int k = 0; k < n; ++k) {
            if ((first + k) % blocks == 0) {
                total = std::move(tallies[k]);
            } else {
                total.rays += tallies[k].rays;
                for (size_t m = 0; m < total.sum.size(); ++m) {
                    total.sum[m] += tallies[k].sum[m];
                    total.squared_spread[m] += tallies[k].squared_spread[m];
                }
            }
            if ((first + k) % blocks != blocks - 1) continue;
            const int v = batch.to_compute[(first + k) / blocks];
            if (shards.are_kept()) shards.save(batch, v, to_bytes(total));
            write(bundles[v], total);
        }
    }
    shards.finish(batch);
    monitor.report({1, "path tracing", 0});

    Report& report = result.report;
    const double traced = cpu_seconds() - built,
                 n_rays = static_cast<double>(rays.camera + rays.bounce + rays.shadow);
    report.settings = {{"method", "path tracer"}, {"paths", std::to_string(tracer.paths())}};
    report.seconds = {{"scene", built - start}, {"path tracing", traced}};
    report.counters = {{"rays", n_rays},
                       {"camera rays", static_cast<double>(rays.camera)},
                       {"bounce rays", static_cast<double>(rays.bounce)},
                       {"shadow rays", static_cast<double>(rays.shadow)},
                       {"rays spared", static_cast<double>(rays.spared)},
                       {"rays lost", static_cast<double>(rays.lost)},
                       {"million rays per CPU second", traced > 0 ? 1e-6 * n_rays / traced : 0}};
    if (rays.spared > 0) report.skipped = {{"rays steeper than the steepest facet", "they hit nothing"}};
    report.relative_error = rms_relative_error(table);
    table.provenance = {{"method", "path tracer"},
                        {"seed", std::to_string(plan.accuracy.seed)},
                        {"paths", std::to_string(tracer.paths())}};
    return result;
}

}  // namespace gonio
