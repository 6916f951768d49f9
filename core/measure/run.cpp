#include "measure/run.h"

#include <time.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "base/sha256.h"
#include "measure/blocks.h"
#include "measure/windows.h"

namespace gonio {
namespace {

std::vector<Block> run_blocks(const RunContext& context, const RunSettings& settings) {
    const int n_lights = static_cast<int>(context.lights.size()),
              n_views = static_cast<int>(context.views.size());
    const auto most_bytes = static_cast<double>(context.max_bytes);
    const bool same =
        !context.view_to_light.empty() && run_bytes(context, settings, n_lights, 0) <= most_bytes;
    int most = 1 << 14;
    while (most > column_block &&
           run_bytes(context, settings, std::min(most, n_lights), std::min(most, n_views)) > most_bytes)
        most /= 2;
    return make_blocks(context, same, most, 256);
}

std::vector<ChannelFactors> map_factors(const RunContext& context, const Tile& tile) {
    std::vector<ChannelFactors> factors;
    const Parameter& albedo = context.lambertian->albedo;
    if (!albedo.is_map()) return factors;
    for (size_t c = 0; c < context.n_channels(); ++c) {
        ChannelFactors f(tile.n_slots(), 0.0f);
        for (int kind = 0; kind < 2; ++kind)
            for (int row = 0; row < tile.area.height; ++row)
                for (int column = 0; column < tile.area.width; ++column) {
                    const int i = wrap_index(tile.area.x0 + column, tile.nx),
                              j = wrap_index(tile.area.y0 + row, tile.ny);
                    f[tile.slot(kind, row, column)] =
                        std::sqrt(albedo.map[(c * albedo.map_ny + j) * albedo.map_nx + i]);
                }
        factors.push_back(std::move(f));
    }
    return factors;
}

// Sums over the windows of a run, for one block of lights and views.
struct Sums {
    std::vector<Matrix> direct;               // per map channel, or one
    std::vector<Matrix> indirect;             // per channel
    std::vector<std::vector<Matrix>> orders;  // [map channel or one][order - 2], if kept
    std::vector<double> projected_lights, projected_views;
    double core_area = 0;

    void add(const Irradiance& irradiance, const std::vector<OrderSeries>& series, double area) {
        auto add_matrix = [](const Matrix& from, Matrix& to) {
            if (to.values.empty()) to = Matrix(from.rows, from.columns);
            for (size_t k = 0; k < to.values.size(); ++k) to.values[k] += from.values[k];
        };
        auto add_vector = [](const std::vector<double>& from, std::vector<double>& to) {
            to.resize(from.size(), 0.0);
            for (size_t k = 0; k < to.size(); ++k) to[k] += from[k];
        };
        direct.resize(irradiance.direct.size());
        orders.resize(irradiance.direct.size());
        for (size_t c = 0; c < direct.size(); ++c) add_matrix(irradiance.direct[c], direct[c]);
        size_t channel = 0;
        for (size_t s = 0; s < series.size(); ++s) {
            for (const Matrix& sum : series[s].sums) {
                indirect.resize(std::max(indirect.size(), channel + 1));
                add_matrix(sum, indirect[channel++]);
            }
            orders[s].resize(std::max(orders[s].size(), series[s].orders.size()));
            for (size_t k = 0; k < series[s].orders.size(); ++k)
                add_matrix(series[s].orders[k], orders[s][k]);
        }
        add_vector(irradiance.projected_lights, projected_lights);
        add_vector(irradiance.projected_views, projected_views);
        core_area += area;
    }
};

// From sums of products to f: f = 1 / (A cos_i cos_o) / pi * ..., divided by the projected areas P_l P_v,
// which are exactly 1 in truth: a ratio estimator, up to 3 times less error for nothing.
void write_rows(const RunContext& context, const Block& block, const Sums& sums, size_t slices,
                RunValues& values) {
    const size_t n_rows = context.rows(), n_channels = context.n_channels();
    const bool map = context.lambertian->albedo.is_map(), plain_area = !context.projected_area_is_known();
    auto view_of = [&](const Block::Row& row) {
        return block.same ? context.lights[block.lights[row.view]] : context.views[block.views[row.view]];
    };
    for (size_t c = 0; c < n_channels; ++c) {
        const double albedo = map ? 1.0 : context.lambertian->albedo.constant[c];
        const Matrix& direct = sums.direct[map ? c : 0];
        const std::vector<Matrix>& orders = sums.orders[map ? c : 0];
        for (const Block::Row& row : block.rows) {
            const double projected =
                plain_area
                    ? std::pow(sums.core_area, 2) * context.lights[block.lights[row.light]].z * view_of(row).z
                    : sums.projected_lights[row.light] * sums.projected_views[row.view];
            // area cos_i cos_o P_l P_v = projected_l projected_v / area
            const double unit = projected > 0 ? sums.core_area / (pi * projected) : 0.0,
                         scale = albedo * unit;
            auto put = [&](size_t slice, double f) {
                values.f[(c * slices + slice) * n_rows + row.row] = static_cast<float>(f);
            };
            const double first = scale * direct(row.light, row.view);
            double total = first;
            if (c == 0) values.direct[row.row] = static_cast<float>(unit * direct(row.light, row.view));
            if (slices > 1) put(1, first);
            if (c < sums.indirect.size()) total += scale * sums.indirect[c](row.light, row.view);
            double power = albedo;
            for (size_t k = 0; k < orders.size() && k + 2 < slices; ++k, power *= albedo)
                put(k + 2, scale * power * orders[k](row.light, row.view));
            put(0, total);
        }
    }
}

}  // namespace

RunShifts::RunShifts(uint64_t seed, int stage, int run)
    : seed_(seed), stream_(static_cast<uint64_t>(stage) << 32 | static_cast<uint32_t>(run)) {}

double RunShifts::operator()(int which) const {
    return uniform_double(random_words(seed_, stream_, which)[0]);
}

double thread_seconds() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::vector<SubSample> shifted_sub_samples(int n, double shift_a, double shift_b) {
    std::vector<SubSample> samples;
    for (int k = 0; k < n; ++k)
        samples.push_back({fractional_part(shift_a + k * 0.7548776662466927),
                           fractional_part(shift_b + k * 0.5698402909980532)});
    return samples;
}

double run_bytes(const RunContext& context, const RunSettings& settings, int n_lights, int n_views) {
    const HeightField& s = *context.surface;
    double cells = static_cast<double>(s.nx) * s.ny;
    if (settings.tiles_x > 0) cells = std::min(cells, std::pow(tile_core + 2.0 * tile_halo, 2));
    const double unknowns = 2 * cells * settings.refinement * settings.refinement;
    const auto padded = [](int n) { return (n + column_block - 1) / column_block * column_block; };
    // Irradiance, carried orders (three at once is typical), a second copy with several sub-samples or a map;
    // sums in double.
    const double copies = 4.0 + (settings.sub_samples > 1 ? 1 : 0) +
                          (context.lambertian->albedo.is_map() ? 1 : 0) +
                          (context.keep_orders || context.n_channels() > 1 ? 4 : 0);
    const double sums = static_cast<double>(padded(n_lights)) *
                        padded(std::max(n_views, n_views == 0 ? n_lights : 0)) * 8 * 6;
    const double links =
        unknowns * settings.directions / (settings.refinement * settings.refinement) * 0.35 * sizeof(Link);
    const double turned =
        s.base.is_curved() ? turned_coefficients(s.base) * 2.5 * unknowns * 4 * padded(n_lights) : 0;
    return turned + copies * unknowns * 4 * (padded(n_lights) + padded(n_views)) + sums + links;
}

std::string settings_key(TransportKind transport, const RunSettings& settings,
                         std::initializer_list<double> beside) {
    std::vector<double> numbers{
        static_cast<double>(transport),           static_cast<double>(settings.sub_samples),
        static_cast<double>(settings.directions), static_cast<double>(settings.refinement),
        static_cast<double>(settings.tiles_x),    static_cast<double>(settings.tiles_y),
        static_cast<double>(settings.block_step)};
    numbers.insert(numbers.end(), beside);
    return sha256_hex(bytes_of(numbers.data(), numbers.size())).substr(0, 16);
}

RunValues run_once(const RunContext& context, const RunSettings& settings, int stage, int run, int n_threads,
                   const Monitor& monitor) {
    const RunShifts shifts(context.plan->accuracy.seed, stage, run);
    const size_t n_rows = context.rows(), n_channels = context.n_channels();
    RunValues values;
    const std::vector<Tile> tiles = run_tiles(context, settings, shifts(0), shifts(1));

    const std::vector<SubSample> sub_samples =
        shifted_sub_samples(settings.sub_samples, shifts(2), shifts(3));
    const double slope = context.grid->max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    const DirectionSet set = slab_directions(settings.directions, z_max, shifts(4), shifts(5));
    const std::vector<SubSample> jitter = shifted_sub_samples(settings.directions, shifts(6), shifts(7));

    size_t slices = 0;
    for (const Block& block : run_blocks(context, settings)) {
        std::vector<Vec3> lights, views;
        for (const int l : block.lights) lights.push_back(context.lights[l]);
        if (block.same)
            views = lights;
        else
            for (const int v : block.views) views.push_back(context.views[v]);
        Sums sums;
        for (const Tile& tile : tiles) {
            monitor.check_cancelled();
            const std::vector<ChannelFactors> factors = map_factors(context, tile);
            double clock = thread_seconds();
            Irradiance irradiance =
                compute_irradiance(*context.grid, tile, lights, views, block.same, sub_samples, factors,
                                   context.allow_skips, n_threads, monitor);
            values.rays += irradiance.rays;
            values.rays_skipped += irradiance.rays_skipped;
            values.truncated_bundles += irradiance.truncated_bundles;
            values.seconds_direct += thread_seconds() - clock;
            std::vector<OrderSeries> series;
            if (context.transports()) {
                clock = thread_seconds();
                const LinkOperator op =
                    build_link_operator(*context.grid, tile, set, jitter, n_threads, monitor);
                values.rays += op.rays;
                values.links += op.links;
                values.substituted += op.substituted;
                values.dropped += op.dropped;
                values.seconds_links += thread_seconds() - clock;
                clock = thread_seconds();
                SeriesOptions options;
                options.max_order = context.max_order;
                options.tolerance = context.series_tolerance;
                options.fixed_applications = context.fixed_applications;
                // Orders that are kept apart add up over windows only if all windows have them.
                if (context.plan->separate_orders && context.max_order == 0 && values.applications > 0)
                    options.fixed_applications = values.applications;
                options.keep_first = context.keep_first && slices == 0 && settings.tiles_x == 0;
                options.keep_orders = context.keep_orders;
                if (!context.lambertian->albedo.is_map())
                    options.albedos = context.lambertian->albedo.constant;
                const bool curved = context.surface->base.is_curved();
                TurnedLight turned;
                if (curved) {
                    const double turn = rms_turn(op);
                    values.turn = std::max(values.turn, turn);
                    turned = turned_light(*context.grid, tile, lights, irradiance.lights, turn_step(turn),
                                          sub_samples, context.allow_skips, n_threads, monitor);
                    values.rays += turned.rays;
                }
                const Fields base_lights = factors.size() > 1 ? irradiance.lights : Fields(),
                             base_views = factors.size() > 1 ? irradiance.views : Fields();
                for (size_t c = 0; c < std::max<size_t>(1, factors.size()); ++c) {
                    if (!factors.empty()) {
                        if (c > 0) {
                            irradiance.lights = base_lights;
                            irradiance.views = base_views;
                        }
                        scale_rows(irradiance.lights, tile, factors[c], n_threads);
                        if (!block.same) scale_rows(irradiance.views, tile, factors[c], n_threads);
                    }
                    const ChannelFactors* channel = factors.empty() ? nullptr : &factors[c];
                    if (curved) {
                        TurnedLight light = turned;
                        if (channel)
                            for (Fields& f : light.coefficients) scale_rows(f, tile, *channel, n_threads);
                        series.push_back(turned_series(op, tile, std::move(light), irradiance.view_fields(),
                                                       channel, options, n_threads, monitor));
                    } else {
                        series.push_back(diffuse_series(op, tile, irradiance.lights, irradiance.view_fields(),
                                                        block.same, channel, options, n_threads, monitor));
                    }
                    if (options.keep_first && c == 0) {
                        values.first = std::move(series.back().first);
                        values.first_irradiance = first_block(
                            curved || block.same || lights.size() <= views.size() ? irradiance.lights
                                                                                  : irradiance.views);
                    }
                    values.ratio = std::max(values.ratio, series.back().ratio);
                    values.remainder = std::max(values.remainder, series.back().remainder);
                    values.applications = std::max(values.applications, series.back().applications);
                    values.higher_orders =
                        std::max(values.higher_orders, static_cast<int>(series.back().orders.size()));
                }
                values.seconds_series += thread_seconds() - clock;
            }
            sums.add(irradiance, series, tile.core_area());
        }
        if (slices == 0) {
            const int single = context.single_orders > 0 ? context.single_orders : values.higher_orders + 1;
            slices = context.plan->separate_orders ? single + 1 : 1;
            values.projected_lights.assign(context.lights.size(), 1.0f);
            values.projected_views.assign(context.views.size(), 1.0f);
            values.f.assign(n_channels * slices * n_rows, 0.0f);
            values.direct.assign(n_rows, 0.0f);
        }
        write_rows(context, block, sums, slices, values);
        for (size_t l = 0; l < block.lights.size(); ++l)
            values.projected_lights[block.lights[l]] = static_cast<float>(
                sums.projected_lights[l] / (sums.core_area * context.lights[block.lights[l]].z));
        if (block.same)
            for (size_t v = 0; v < context.views.size(); ++v)
                values.projected_views[v] = values.projected_lights[context.view_to_light[v]];
        else
            for (size_t v = 0; v < block.views.size(); ++v)
                values.projected_views[block.views[v]] = static_cast<float>(
                    sums.projected_views[v] / (sums.core_area * context.views[block.views[v]].z));
    }
    return values;
}

}  // namespace gonio
