#include "measure/graph_run.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "material/lobe_shape.h"
#include "measure/blocks.h"
#include "measure/planning.h"
#include "measure/windows.h"
#include "scattering/glossy_direct.h"
#include "scattering/sampled_orders.h"
#include "scattering/turned_light.h"

namespace gonio {
namespace {

constexpr int light_block = 64;  // lights that are swept through the graph at a time

std::vector<Block> run_blocks(const GraphContext& context, const RunSettings& settings) {
    const int n_lights = static_cast<int>(context.lights.size()),
              n_views = static_cast<int>(context.views.size());
    int most = 1 << 12;
    while (most > light_block &&
           graph_run_bytes(context, settings, std::min(most, n_lights), std::min(most, n_views)) >
               static_cast<double>(context.max_bytes))
        most /= 2;
    const bool same = !context.view_to_light.empty() && n_lights <= most;
    return make_blocks(context, same, most, 32);
}

// (C + C^T) / 2: true by reciprocity, and noise of half the variance.
void symmetrise(Matrix& m) {
    for (int i = 0; i < m.rows; ++i)
        for (int j = 0; j < i; ++j) m(i, j) = m(j, i) = 0.5 * (m(i, j) + m(j, i));
}

// Lights or views of a block: their bits for a few sub-samples at a time, and the mean over all of them.
struct Side {
    std::vector<Vec3> directions;
    DirectionArrays arrays;
    VisibilityBits bits;
    VisibleCosines visible;

    explicit Side(std::vector<Vec3> of) : directions(std::move(of)), arrays(directions) {}
};

// Sums over the windows of a run, for one block of lights and views.
struct Sums {
    std::vector<Matrix> direct;               // per channel group
    std::vector<std::vector<Matrix>> orders;  // per channel group: as GraphOrders::orders
    std::vector<double> projected_lights, projected_views;
    double core_area = 0;
};

class BlockRun {
  public:
    // number: of the run.
    BlockRun(const GraphContext& context, const RunSettings& settings, const RunShifts& shifts,
             uint64_t number, const Block& block, int n_threads, const Monitor& monitor)
        : context_(context),
          settings_(settings),
          shifts_(shifts),
          number_(number),
          block_(block),
          n_threads_(n_threads),
          monitor_(monitor) {
        sums_.direct.resize(context.channel_groups.size());
        sums_.orders.resize(context.channel_groups.size());
    }

    void add_tile(const Tile& tile, RunValues& values) {
        Side lights(directions(block_.lights, context_.lights)),
            views(directions(block_.views, context_.views));
        std::vector<SlotMaterial> materials;
        for (const ChannelGroup& group : context_.channel_groups)
            materials.push_back(
                slot_material(*context_.material, *context_.surface, tile, group.channels[0]));
        double clock = thread_seconds();
        add_direct_light(tile, materials, lights, views, values);
        values.seconds_direct += thread_seconds() - clock;
        if (context_.transports()) {
            const Side& to = block_.same ? lights : views;
            const int max_order = context_.plan->max_order,
                      sampled = first_sampled_order(context_, tile, settings_.directions);
            if (sampled != 2) add_orders(tile, materials, lights, to, sampled == 3 ? 2 : max_order, values);
            if (sampled > 0 && (max_order == 0 || max_order >= sampled))
                add_sampled_orders(tile, materials, lights, to, sampled, values);
        }
        sums_.core_area += tile.core_area();
        ++tiles_;
    }

    const Sums& sums() const { return sums_; }

  private:
    static std::vector<Vec3> directions(const std::vector<int>& which, const std::vector<Vec3>& all) {
        std::vector<Vec3> chosen;
        for (const int k : which) chosen.push_back(all[k]);
        return chosen;
    }

    void add_direct_light(const Tile& tile, const std::vector<SlotMaterial>& materials, Side& lights,
                          Side& views, RunValues& values) {
        const std::vector<SubSample> samples =
            shifted_sub_samples(settings_.sub_samples, shifts_(2), shifts_(3));
        const double share = 1.0 / settings_.sub_samples;
        for (Matrix& sum : sums_.direct)
            if (sum.values.empty())
                sum = Matrix(lights.arrays.n, block_.same ? lights.arrays.n : views.arrays.n);
        auto look = [&](Side& side, const std::vector<SubSample>& some) {
            side.bits = find_visibility(*context_.grid, tile, side.directions, some, context_.allow_skips,
                                        n_threads_, monitor_);
            values.rays += side.bits.rays;
            values.rays_skipped += side.bits.rays_skipped;
            values.truncated_bundles += side.bits.truncated_bundles;
            add_cosines(tile, side.directions, side.bits, share, n_threads_, side.visible);
        };
        for (size_t first = 0; first < samples.size(); first += most_bits) {
            const std::vector<SubSample> some(
                samples.begin() + static_cast<long>(first),
                samples.begin() + static_cast<long>(std::min(samples.size(), first + most_bits)));
            look(lights, some);
            if (!block_.same) look(views, some);
            for (size_t g = 0; g < materials.size(); ++g)
                add_direct(materials[g], tile, lights.arrays, block_.same ? lights.arrays : views.arrays,
                           block_.same, lights.bits, views.bits, share, n_threads_, monitor_,
                           sums_.direct[g]);
        }
        auto add_projected = [&](const Side& side, std::vector<double>& sums) {
            const std::vector<double> areas = projected_areas(tile, side.visible, side.arrays.n);
            sums.resize(areas.size(), 0.0);
            for (size_t k = 0; k < areas.size(); ++k) sums[k] += areas[k];
        };
        add_projected(lights, sums_.projected_lights);
        add_projected(block_.same ? lights : views, sums_.projected_views);
    }

    void add_orders(const Tile& tile, const std::vector<SlotMaterial>& materials, const Side& lights,
                    const Side& views, int max_order, RunValues& values) {
        double clock = thread_seconds();
        const PairGraph graph = run_pairs(context_, settings_, tile, shifts_, n_threads_, monitor_);
        values.rays += graph.rays;
        values.links += static_cast<double>(graph.size());
        values.substituted += graph.substituted;
        values.dropped += graph.dropped;
        values.seconds_links += thread_seconds() - clock;
        clock = thread_seconds();
        GraphOptions options;
        options.max_order = max_order;
        options.keep_orders = context_.keep_orders();
        options.tolerance = context_.series_tolerance;
        const GraphSide view_side{views.arrays, &views.visible, 0};
        std::optional<TurnNodes> nodes;
        if (context_.surface->base.is_curved()) {
            const double turn = rms_turn(graph);
            values.turn = std::max(values.turn, turn);
            nodes.emplace(context_.surface->base, turn_step(turn));
        }
        const int at_once = nodes ? light_block / nodes->count() : light_block;
        for (int first = 0; first < lights.arrays.n; first += at_once) {
            const auto begin = lights.directions.begin() + first;
            const int n = std::min(at_once, lights.arrays.n - first);
            GraphSide light_side;
            TurnedLights turned;
            if (nodes) {
                turned = turned_lights(*context_.grid, tile, {begin, begin + n}, *nodes,
                                       shifted_sub_samples(settings_.sub_samples, shifts_(2), shifts_(3)),
                                       context_.allow_skips, n_threads_, monitor_);
                values.rays += turned.rays;
                light_side = {turned.directions, &turned.visible, 0, &*nodes};
            } else {
                light_side = {DirectionArrays({begin, begin + n}), &lights.visible,
                              static_cast<size_t>(first)};
            }
            for (size_t g = 0; g < materials.size(); ++g) {
                // Orders that are kept apart add up over lights, windows and runs only if all have them.
                if (context_.plan->separate_orders)
                    options.fixed_orders =
                        context_.single_orders > 0 ? context_.single_orders - 1 : values.applications;
                else if (options.keep_orders)
                    options.fixed_orders = values.applications;
                GraphOrders found = scatter_orders(graph, tile, materials[g], light_side, view_side, options,
                                                   n_threads_, monitor_);
                values.applications = std::max(values.applications, found.n_orders);
                values.ratio = std::max(values.ratio, found.ratio);
                values.remainder = std::max(values.remainder, found.remainder);
                values.heaviest = std::max(values.heaviest, found.heaviest);
                for (size_t k = 0; k < found.orders.size(); ++k)
                    add(found.orders[k], first, lights.arrays.n, sums_.orders[g], k);
            }
        }
        values.seconds_series += thread_seconds() - clock;
    }

    // Rows of lights from `first` on, to the k-th of the orders that are kept apart, or of their sum.
    static void add(const Matrix& order, int first, int n_lights, std::vector<Matrix>& sums, size_t k) {
        sums.resize(std::max(sums.size(), k + 1));
        if (sums[k].values.empty()) sums[k] = Matrix(n_lights, order.columns);
        for (int l = 0; l < order.rows; ++l)
            for (int v = 0; v < order.columns; ++v) sums[k](first + l, v) += order(l, v);
    }

    void add_sampled_orders(const Tile& tile, const std::vector<SlotMaterial>& materials, const Side& lights,
                            const Side& views, int first_order, RunValues& values) {
        const double clock = thread_seconds();
        if (!trace_grid_) trace_grid_ = make_trace_grid(*context_.surface);
        SampledScene scene{*context_.surface, *trace_grid_, *context_.material, tile, {}, materials};
        for (const ChannelGroup& group : context_.channel_groups) scene.channels.push_back(group.channels[0]);
        SamplingOptions options;
        options.first_order = first_order;
        options.max_order = context_.plan->max_order;
        options.keep_orders = context_.keep_orders();
        options.tolerance = context_.series_tolerance;
        options.rays_per_facet = sampled_rays_per_facet(settings_);
        options.seed = context_.plan->accuracy.seed;
        options.stream = number_;
        options.tile_number = tiles_;
        options.light_numbers = block_.lights;
        const SampledOrders found =
            sample_orders(scene, {lights.arrays, &lights.visible}, {views.arrays, &views.visible}, options,
                          n_threads_, monitor_);
        for (size_t g = 0; g < found.orders.size(); ++g)
            for (size_t k = 0; k < found.orders[g].size(); ++k)
                add(found.orders[g][k], 0, lights.arrays.n, sums_.orders[g],
                    options.keep_orders ? k + first_order - 2 : 0);
        values.applications = std::max(values.applications, found.n_orders);
        values.remainder = std::max(values.remainder, found.remainder);
        values.rays += found.rays;
        values.dropped += found.rays_lost;
        values.seconds_series += thread_seconds() - clock;
    }

    const GraphContext& context_;
    const RunSettings& settings_;
    const RunShifts& shifts_;
    const uint64_t number_;
    const Block& block_;
    int n_threads_;
    const Monitor& monitor_;
    std::optional<TraceGrid> trace_grid_;  // made when it is needed
    uint64_t tiles_ = 0;                   // so far
    Sums sums_;
};

// f = 1 / (A cos_i cos_o) * ..., divided by the projected areas P_l P_v, which are exactly 1 in truth: a
// ratio estimator, up to 3 times less error for nothing.
void write_rows(const GraphContext& context, const Block& block, const Sums& sums, size_t slices,
                RunValues& values) {
    const size_t n_rows = context.rows();
    const bool plain_area = !context.projected_area_is_known();
    for (const Block::Row& row : block.rows) {
        const Vec3 &light = context.lights[block.lights[row.light]],
                   &view = block.same ? context.lights[block.lights[row.view]]
                                      : context.views[block.views[row.view]];
        const double projected = plain_area
                                     ? std::pow(sums.core_area, 2) * light.z * view.z
                                     : sums.projected_lights[row.light] * sums.projected_views[row.view];
        const double unit = projected > 0 ? sums.core_area / projected : 0.0;
        for (size_t g = 0; g < context.channel_groups.size(); ++g) {
            const ChannelGroup& group = context.channel_groups[g];
            for (size_t k = 0; k < group.channels.size(); ++k) {
                const size_t c = group.channels[k];
                auto put = [&](size_t slice, double f) {
                    values.f[(c * slices + slice) * n_rows + row.row] = static_cast<float>(f);
                };
                double power = group.scale[k];
                const double first = unit * power * sums.direct[g](row.light, row.view);
                if (c == 0) values.direct[row.row] = static_cast<float>(first);
                if (slices > 1) put(1, first);
                double total = first;
                for (size_t order = 0; order < sums.orders[g].size(); ++order) {
                    power *= group.scale[k];
                    const double f = unit * power * sums.orders[g][order](row.light, row.view);
                    total += f;
                    if (order + 2 < slices) put(order + 2, f);
                }
                put(0, total);
            }
        }
    }
}

}  // namespace

bool GraphContext::keep_orders() const {
    return plan->separate_orders ||
           std::any_of(channel_groups.begin(), channel_groups.end(), [](const ChannelGroup& group) {
               return std::any_of(group.scale.begin(), group.scale.end(),
                                  [](double scale) { return scale != 1; });
           });
}

double graph_run_bytes(const GraphContext& context, const RunSettings& settings, int n_lights, int n_views) {
    const HeightField& s = *context.surface;
    double cells = static_cast<double>(s.nx) * s.ny;
    if (settings.tiles_x > 0) cells = std::min(cells, std::pow(tile_core + 2.0 * tile_halo, 2));
    const double unknowns = 2 * cells * settings.refinement * settings.refinement;
    // Bits and mean cosines of every direction; 15 % of the slots are pairs at slope 0.5, more on steeper
    // reliefs.
    const double sides = 8 * unknowns * (n_lights + n_views + 32),
                 pairs = unknowns * settings.directions / (s.base.corrects_horizons() ? 1.0 : 9.0) * 0.35,
                 turned = s.base.is_curved() ? 8 * unknowns * light_block + sizeof(PairBend) * pairs : 0;
    // Rays along lobes may meet any cell of the surface. At the largest subset of facets:
    const double slope = context.grid->max_slope,
                 share = highest_peak(*context.material) * 4 * pi * slope / std::sqrt(1 + slope * slope) * 9 *
                         settings.refinement * settings.refinement / settings.directions,
                 traced = share > narrow_share_of_pair ? 24.0 * s.nx * s.ny : 0.0;
    return sides + turned + traced + 20 * pairs +
           scatter_bytes(pairs, std::min(n_lights * turned_coefficients(s.base), light_block), n_views) +
           16.0 * 2 * n_lights * n_views * static_cast<double>(context.channel_groups.size());
}

double lobe_share_of_pair(const Material& material, const MarchGrid& grid, const Tile& tile,
                          int n_directions) {
    const double slope = grid.max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    return highest_peak(material) * 4 * pi * z_max / n_directions *
           facet_subset(tile, grid.base, n_directions) * tile.n_parts();
}

int first_sampled_order(const MeasuredScene& scene, const Tile& tile, int n_directions) {
    if (scene.surface->base.is_curved()) return 0;
    const double share = lobe_share_of_pair(*scene.material, *scene.grid, tile, n_directions);
    return share > most_share_of_order_2 ? 2 : share > narrow_share_of_pair ? 3 : 0;
}

double sampled_rays_per_facet(const RunSettings& settings) {
    return settings.directions / 256.0;
}

double pairs_per_facet(const HeightField& surface, const Tile& tile, int n_directions) {
    return n_directions * share_that_hits(rms_slope(surface)) /
           facet_subset(tile, surface.base, n_directions);
}

PairGraph run_pairs(const GraphContext& context, const RunSettings& settings, const Tile& tile,
                    const RunShifts& shifts, int n_threads, const Monitor& monitor) {
    const double slope = context.grid->max_slope, z_max = slope / std::sqrt(1 + slope * slope);
    const int subset = facet_subset(tile, context.grid->base, settings.directions);
    return trace_pairs(*context.grid, tile, slab_directions(settings.directions, z_max, shifts(4), shifts(5)),
                       shifted_sub_samples(settings.directions, shifts(6), shifts(7)), subset,
                       static_cast<int>(shifts(8) * subset), n_threads, monitor);
}

RunValues graph_run(const GraphContext& context, const RunSettings& settings, int stage, int run,
                    int n_threads, const Monitor& monitor) {
    const RunShifts shifts(context.plan->accuracy.seed, stage, run);
    const std::vector<Tile> tiles = run_tiles(context, settings, shifts(0), shifts(1));
    RunValues values;
    values.projected_lights.assign(context.lights.size(), 1.0f);
    values.projected_views.assign(context.views.size(), 1.0f);
    values.direct.assign(context.rows(), 0.0f);
    size_t slices = 0;
    for (const Block& block : run_blocks(context, settings)) {
        BlockRun of_block(context, settings, shifts,
                          static_cast<uint64_t>(stage) << 32 | static_cast<uint32_t>(run), block, n_threads,
                          monitor);
        for (const Tile& tile : tiles) {
            monitor.check_cancelled();
            of_block.add_tile(tile, values);
        }
        Sums sums = of_block.sums();
        // On a curved base light that enters at one point leaves at another, whose frame counts.
        if (block.same && !context.surface->base.is_curved())
            for (auto& orders : sums.orders)
                for (Matrix& m : orders) symmetrise(m);
        if (slices == 0) {
            values.higher_orders = values.applications;
            const int single = context.single_orders > 0 ? context.single_orders : values.higher_orders + 1;
            slices = context.plan->separate_orders ? single + 1 : 1;
            values.f.assign(context.n_channels() * slices * context.rows(), 0.0f);
        }
        write_rows(context, block, sums, slices, values);
        auto ratio = [&](double projected, const Vec3& d) {
            return static_cast<float>(projected / (sums.core_area * d.z));
        };
        for (size_t l = 0; l < block.lights.size(); ++l)
            values.projected_lights[block.lights[l]] =
                ratio(sums.projected_lights[l], context.lights[block.lights[l]]);
        if (block.same)
            for (size_t v = 0; v < context.views.size(); ++v)
                values.projected_views[v] = values.projected_lights[context.view_to_light[v]];
        else
            for (size_t v = 0; v < block.views.size(); ++v)
                values.projected_views[block.views[v]] =
                    ratio(sums.projected_views[v], context.views[block.views[v]]);
    }
    return values;
}

}  // namespace gonio
