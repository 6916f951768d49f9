// Light swept through the pair graph, order by order.
#include "scattering/pair_graph.h"

#include <cblas.h>

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace gonio {
namespace {

constexpr size_t chunk_pairs = 256;
constexpr int most_orders = 64;

// What the kernels are given of a stretch of pairs: slots, and directions with a sign.
struct PairBatch {
    std::vector<uint32_t> slot;
    std::vector<float> x, y, z;

    void clear() {
        for (auto* axis : {&x, &y, &z}) axis->clear();
        slot.clear();
    }
    void add(const PairDirection& d, float sign, size_t at) {
        slot.push_back(static_cast<uint32_t>(at));
        x.push_back(sign * d.x);
        y.push_back(sign * d.y);
        z.push_back(sign * d.z);
    }
};

class Sweep {
  public:
    Sweep(const PairGraph& graph, const Tile& tile, const SlotMaterial& material, const GraphSide& lights,
          const GraphSide& views, int n_threads, const Monitor& monitor)
        : graph_(graph),
          tile_(tile),
          material_(material),
          lights_(lights),
          views_(views),
          n_threads_(n_threads),
          monitor_(monitor),
          columns_(lights.directions.x.size()),
          wanted_(lights.nodes ? lights.n_lights() : columns_),
          core_area_(core_areas(tile)) {}

    size_t size() const { return graph_.size() * columns_; }

    FirstOrder first_order() const {
        FirstOrder first;
        HugeFloats& radiance = first.radiance;
        radiance.resize(size());
        for_chunks([&](size_t begin, size_t end) {
            PairBatch batch;
            for (size_t e = begin; e < end; ++e)
                batch.add(graph_.arriving_at(e), -1, graph_.seen[e] % tile_.n_slots());
            float* out = &radiance[begin * columns_];
            rows(batch, lights_.directions, out);
            std::vector<float> scratch(columns_);
            for (size_t e = begin; e < end; ++e, out += columns_) {
                const float* g = lights_.visible->of(graph_.seen[e]) + lights_.first;
                for (size_t c = 0; c < columns_; ++c) out[c] *= g[c];
                turn_back(e, out, scratch);
            }
        });
        first.arrived = arrived_directly();
        return first;
    }

    // R_{k+1} from R_k, added to `total` if there is one.
    void next_order(const HugeFloats& from, HugeFloats& to, HugeFloats* total, double& heaviest) const {
        to.resize(size());
        const int n_tasks = static_cast<int>(std::min<size_t>(256, tile_.n_unknowns()));
        std::vector<float> largest(n_tasks, 0.0f);
        parallel_for(n_tasks, n_threads_, [&](int task) {
            monitor_.check_cancelled();
            PairBatch batch;
            DirectionArrays leaving;
            std::vector<float> weights, cosines, scratch(columns_);
            const size_t begin = tile_.n_unknowns() * task / n_tasks,
                         end = tile_.n_unknowns() * (task + 1) / n_tasks;
            for (size_t u = begin; u < end; ++u) {
                const size_t arriving = graph_.in[u + 1] - graph_.in[u], first = graph_.out[u],
                             n = graph_.out[u + 1] - first;
                if (arriving == 0) continue;
                const size_t slot = u % tile_.n_slots(), padded = (n + 15) / 16 * 16;
                if (n > 0) {
                    for (auto* axis : {&leaving.x, &leaving.y, &leaving.z}) axis->assign(padded, 0.0f);
                    cosines.resize(n);
                    for (size_t t = 0; t < n; ++t) {
                        const PairDirection d = graph_.leaving(first + t);
                        leaving.x[t] = d.x;
                        leaving.y[t] = d.y;
                        leaving.z[t] = d.z;
                        cosines[t] = graph_.solid_angle_of(first + t) * cosine(slot, d);
                    }
                    batch.clear();
                    for (size_t k = 0; k < arriving; ++k)
                        batch.add(graph_.arriving_at(graph_.arriving[graph_.in[u] + k]), -1, slot);
                    weights.resize(arriving * padded);
                    rows(batch, leaving, weights.data());
                }
                for (size_t k = 0; k < arriving; ++k) {
                    float* w = weights.data() + k * padded;
                    for (size_t t = 0; t < n; ++t) {
                        w[t] *= cosines[t];
                        largest[task] = std::max(largest[task], w[t]);
                    }
                    const size_t e = graph_.arriving[graph_.in[u] + k];
                    float* sum = total ? &(*total)[e * columns_] : nullptr;
                    combine_rows(w, n, from.data() + first * columns_, columns_, &to[e * columns_],
                                 lights_.nodes ? nullptr : sum);
                    if (!lights_.nodes) continue;
                    turn_back(e, &to[e * columns_], scratch);
                    for (size_t c = 0; sum && c < columns_; ++c) sum[c] += to[e * columns_ + c];
                }
            }
        });
        for (const float w : largest) heaviest = std::max(heaviest, static_cast<double>(w));
    }

    // What the views receive.
    Matrix received(const HugeFloats& radiance) const {
        [[maybe_unused]] static const bool single_threaded_blas = (openblas_set_num_threads(1), true);
        const size_t padded = views_.directions.x.size(), panel = wanted_ * padded;
        const size_t n_chunks = (graph_.size() + chunk_pairs - 1) / chunk_pairs;
        const int n_groups =
            static_cast<int>(std::clamp<size_t>((size_t{64} << 20) / (panel * sizeof(double)), 2, 16));
        std::vector<std::vector<double>> partial(n_groups);
        parallel_for(n_groups, n_threads_, [&](int group) {
            partial[group].assign(panel, 0.0);
            std::vector<float> y, product(panel);
            PairBatch batch;
            for (size_t k = n_chunks * group / n_groups; k < n_chunks * (group + 1) / n_groups; ++k) {
                monitor_.check_cancelled();
                const size_t begin = k * chunk_pairs, end = std::min(begin + chunk_pairs, graph_.size());
                batch.clear();
                for (size_t e = begin; e < end; ++e)
                    batch.add(graph_.leaving(e), 1, graph_.start[e] % tile_.n_slots());
                y.resize((end - begin) * padded);
                rows(batch, views_.directions, y.data());
                for (size_t e = begin; e < end; ++e) {
                    const size_t slot = batch.slot[e - begin];
                    const float weight =
                        core_area_[slot] * graph_.solid_angle_of(e) * cosine(slot, graph_.leaving(e));
                    const float* g = views_.visible->of(graph_.start[e]) + views_.first;
                    float* row = &y[(e - begin) * padded];
                    for (size_t c = 0; c < padded; ++c) row[c] *= weight * g[c];
                }
                cblas_sgemm(CblasRowMajor, CblasTrans, CblasNoTrans, static_cast<int>(wanted_),
                            static_cast<int>(padded), static_cast<int>(end - begin), 1.0f,
                            &radiance[begin * columns_], static_cast<int>(columns_), y.data(),
                            static_cast<int>(padded), 0.0f, product.data(), static_cast<int>(padded));
                for (size_t c = 0; c < panel; ++c) partial[group][c] += product[c];
            }
        });
        Matrix sum(lights_.n_lights(), views_.directions.n);
        for (int l = 0; l < sum.rows; ++l)
            for (int v = 0; v < sum.columns; ++v)
                for (const auto& p : partial) sum(l, v) += p[l * padded + v];
        return sum;
    }

    // Light that arrives on facets over all lights: of one order, from about 20,000 of the pairs; and direct.
    double arrived(const HugeFloats& radiance) const {
        const size_t step = 1 + graph_.size() / 20000;
        double total = 0;
        for (size_t e = 0; e < graph_.size(); e += step) {
            const size_t slot = graph_.start[e] % tile_.n_slots();
            const float* row = &radiance[e * columns_];
            float sum = 0;
            for (size_t c = 0; c < wanted_; ++c) sum += row[c];
            total += static_cast<double>(tile_.sqrt_area[slot]) * tile_.sqrt_area[slot] *
                     cosine(slot, graph_.leaving(e)) * sum;
        }
        return total * graph_.solid_angle * static_cast<double>(step);
    }
    double arrived_directly() const {
        double total = 0;
        for (size_t u = 0; u < tile_.n_unknowns(); ++u) {
            const float* row = lights_.visible->of(u) + lights_.first;
            float sum = 0;
            for (size_t c = 0; c < wanted_; ++c) sum += row[c];
            const double root = tile_.sqrt_area[u % tile_.n_slots()];
            total += root * root * sum;
        }
        return total;
    }

  private:
    float cosine(size_t slot, const PairDirection& d) const {
        return std::max(0.0f,
                        tile_.normal_x[slot] * d.x + tile_.normal_y[slot] * d.y + tile_.normal_z[slot] * d.z);
    }
    // The lights of a row, told where the pair ends, as they are told where it starts.
    void turn_back(size_t pair, float* row, std::vector<float>& scratch) const {
        if (lights_.nodes)
            lights_.nodes->shift(graph_.bends[pair].turn, lights_.n_lights(), row, scratch.data());
    }
    void rows(const PairBatch& batch, const DirectionArrays& directions, float* out) const {
        lobe_rows(material_, tile_, batch.slot.size(), batch.slot.data(), batch.x.data(), batch.y.data(),
                  batch.z.data(), directions, out);
    }
    template <class Work>
    void for_chunks(Work&& work) const {
        const size_t n_chunks = (graph_.size() + chunk_pairs - 1) / chunk_pairs;
        parallel_for(static_cast<int>(n_chunks), n_threads_, [&](int k) {
            monitor_.check_cancelled();
            work(k * chunk_pairs, std::min((k + 1) * chunk_pairs, graph_.size()));
        });
    }

    const PairGraph& graph_;
    const Tile& tile_;
    const SlotMaterial& material_;
    const GraphSide &lights_, &views_;
    int n_threads_;
    const Monitor& monitor_;
    size_t columns_;
    size_t wanted_;  // the first of them: of lights that are not turned
    std::vector<float> core_area_;
};

void add_scaled(HugeFloats& to, const HugeFloats& from, float factor) {
    for (size_t k = 0; k < to.size(); ++k) to[k] += factor * from[k];
}

// The light of all orders that arrives over the pairs; or of each of them at the views, if they are kept.
HugeFloats sweep_orders(const Sweep& sweep, FirstOrder first, const GraphOptions& options,
                        GraphOrders& result) {
    HugeFloats radiance = std::move(first.radiance), next, total;
    if (!options.keep_orders) total = radiance;
    const double direct = first.arrived;
    // Orders that are not wanted one by one go on for ever as the last two do: alike for all lights and views
    // by then, but for a fifth.
    constexpr double doubt_of_tail = 0.2;
    const bool continues = !options.keep_orders && options.max_order == 0;
    double before = direct, now = sweep.arrived(radiance);
    const int most = options.max_order > 0      ? options.max_order - 1
                     : options.fixed_orders > 0 ? options.fixed_orders
                                                : most_orders;
    for (result.n_orders = 1;; ++result.n_orders) {
        if (options.keep_orders) result.orders.push_back(sweep.received(radiance));
        result.ratio = before > 0 ? now / before : 0.0;
        const double decline = std::min(result.ratio, 0.95);
        double left = direct > 0 ? now * decline / (1 - decline) / direct : 0.0;
        if (continues) left *= doubt_of_tail;
        if (options.max_order == 0) result.remainder = left;
        if (result.n_orders >= most || (options.fixed_orders == 0 && left < options.tolerance)) break;
        sweep.next_order(radiance, next, options.keep_orders ? nullptr : &total, result.heaviest);
        std::swap(radiance, next);
        before = now;
        now = sweep.arrived(radiance);
    }
    if (continues) {
        const double decline = std::min(result.ratio, 0.95);
        add_scaled(total, radiance, static_cast<float>(decline / (1 - decline)));
    }
    return total;
}

}  // namespace

GraphOrders scatter_orders(const PairGraph& graph, const Tile& tile, const SlotMaterial& material,
                           const GraphSide& lights, const GraphSide& views, const GraphOptions& options,
                           int n_threads, const Monitor& monitor) {
    const Sweep sweep(graph, tile, material, lights, views, n_threads, monitor);
    GraphOrders result;
    const HugeFloats total = sweep_orders(sweep, sweep.first_order(), options, result);
    if (!options.keep_orders) result.orders.push_back(sweep.received(total));
    return result;
}

HugeFloats arriving_light(const PairGraph& graph, const Tile& tile, const SlotMaterial& material,
                          const GraphSide& lights, const GraphOptions& options, int n_threads,
                          const Monitor& monitor, GraphOrders& series) {
    const Sweep sweep(graph, tile, material, lights, lights, n_threads, monitor);
    HugeFloats all = sweep_orders(sweep, sweep.first_order(), options, series);
    if (!lights.nodes) return all;
    const size_t n = lights.n_lights(), padded = (n + 15) / 16 * 16, columns = lights.directions.padded();
    HugeFloats wanted(graph.size() * padded);
    for (size_t e = 0; e < graph.size(); ++e) {
        std::copy_n(&all[e * columns], n, &wanted[e * padded]);
        std::fill_n(&wanted[e * padded + n], padded - n, 0.0f);
    }
    return wanted;
}

double rms_turn(const PairGraph& graph) {
    double sum = 0;
    for (const PairBend& bend : graph.bends)
        sum += static_cast<double>(bend.turn.about[0]) * bend.turn.about[0] +
               static_cast<double>(bend.turn.about[1]) * bend.turn.about[1];
    return graph.bends.empty() ? 0 : std::sqrt(sum / static_cast<double>(graph.bends.size()));
}

HugeFloats arriving_light(const PairGraph& graph, const Tile& tile, const SlotMaterial& material,
                          FirstOrder first, size_t columns, const GraphOptions& options, int n_threads,
                          const Monitor& monitor, GraphOrders& series) {
    const GraphSide side{DirectionArrays(std::vector<Vec3>(columns))};  // only their number counts
    return sweep_orders(Sweep(graph, tile, material, side, side, n_threads, monitor), std::move(first),
                        options, series);
}

double scatter_bytes(double n_pairs, int n_lights, int n_views) {
    const auto padded = [](int n) { return (n + 15) / 16 * 16.0; };
    return n_pairs * padded(n_lights) * 4 * 3 + padded(n_lights) * padded(n_views) * 8 * 16;
}

}  // namespace gonio
