#include "measure/glossy_sky.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/parallel.h"
#include "material/lobe_shape.h"
#include "measure/describe.h"
#include "measure/narrow_lobes.h"
#include "measure/sky_light.h"
#include "scattering/irradiance.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr size_t directions_together = 64, receivers_together = 256;

Environment supported_sky(const HeightField& surface, const Material& material,
                          const Environment& environment) {
    for (const WeightedLobe& part : material.lobes)
        if (std::holds_alternative<Mirror>(part.lobe))
            throw Error(ErrorCode::invalid_input, "/material", "mirror",
                        "is in no light field under an environment: needs a lobe of some width, as ggx");
    return sky_on_flat_base(surface, static_cast<int>(material.channels.size()), environment);
}

// Channels that scatter alike: their lobes are computed once.
std::vector<std::vector<size_t>> channels_alike(const Material& material) {
    std::vector<std::vector<size_t>> alike;
    for (const ChannelGroup& group : channel_groups(material)) {
        const size_t first = alike.size();
        std::vector<double> scales;
        for (size_t k = 0; k < group.channels.size(); ++k) {
            const auto found = std::find(scales.begin(), scales.end(), group.scale[k]);
            if (found == scales.end()) {
                scales.push_back(group.scale[k]);
                alike.push_back({group.channels[k]});
            } else {
                alike[first + static_cast<size_t>(found - scales.begin())].push_back(group.channels[k]);
            }
        }
    }
    return alike;
}

size_t padded(size_t columns) {
    return (columns + 15) / 16 * 16;
}

float cosine(const Tile& tile, size_t slot, float x, float y, float z) {
    return std::max(0.0f, tile.normal_x[slot] * x + tile.normal_y[slot] * y + tile.normal_z[slot] * z);
}

// Visits stretches of receivers side by side.
template <class Visit>
void for_stretches(const Receivers& receivers, int n_threads, const Monitor& monitor, Visit&& visit) {
    parallel_for(static_cast<int>((receivers.count + receivers_together - 1) / receivers_together), n_threads,
                 [&](int k) {
                     monitor.check_cancelled();
                     const size_t first = k * receivers_together,
                                  count = std::min(receivers_together, receivers.count - first);
                     SeenParts parts;
                     parts.resize(count);
                     receivers.parts(first, count, parts);
                     visit(first, count, parts);
                 });
}

// Products of 16 columns at a time: a sum in this order on every instruction set.
float dot_product(const float* a, const float* b, const float* c, size_t n) {
    float lanes[16] = {};
    for (size_t k = 0; k < n; k += 16)
        for (size_t lane = 0; lane < 16; ++lane) lanes[lane] += a[k + lane] * b[k + lane] * c[k + lane];
    for (size_t step = 8; step > 0; step /= 2)
        for (size_t lane = 0; lane < step; ++lane) lanes[lane] += lanes[lane + step];
    return lanes[0];
}

}  // namespace

void SeenParts::resize(size_t n) {
    unknown.resize(n);
    for (auto* axis : {&x, &y, &z}) axis->resize(n);
}

void SeenParts::set(size_t k, size_t part, const Vec3& towards) {
    unknown[k] = static_cast<uint32_t>(part);
    x[k] = static_cast<float>(towards.x), y[k] = static_cast<float>(towards.y),
    z[k] = static_cast<float>(towards.z);
}

struct GlossySky::Lit {
    DirectionArrays directions;
    VisibleCosines visible;
    std::vector<std::vector<float>> light;  // [channel], padded
};

double GlossySky::run_bytes(const HeightField& surface, const Accuracy::Samples& samples, int n_channels) {
    const double unknowns = 2.0 * surface.nx * surface.ny * samples.refinement * samples.refinement,
                 pairs = unknowns * samples.directions / 9.0 * 0.35;
    return 8 * unknowns * directions_together + pairs * (20 + (4 + 4 * 16) * n_channels + 3 * 4 * 16);
}

// Measured on 96 x 96 and 128 x 128 points, GGX, 1 to 16 views.
double GlossySky::run_seconds(const HeightField& surface, const Accuracy::Samples& samples, int n_channels,
                              int azimuths, double n_receivers) {
    const double unknowns = 2.0 * surface.nx * surface.ny * samples.refinement * samples.refinement,
                 pairs = unknowns * samples.directions * 0.04;
    return samples.sub_samples * static_cast<double>(azimuths) * azimuths *
           (20e-9 * unknowns + 2.2e-9 * n_channels * (n_receivers + pairs));
}

GlossySky::GlossySky(const HeightField& surface, const Material& material, const Environment& environment,
                     int azimuths, int max_order, const Accuracy::Samples& samples, uint64_t seed,
                     const RunOptions& options, const Monitor& monitor)
    : samples_(samples),
      seed_(seed),
      options_(options),
      monitor_(monitor),
      n_directions_(azimuths * azimuths),
      max_order_(max_order),
      sky_(supported_sky(surface, material, environment)),
      surface_(surface),
      material_(simplified(material)),
      alike_(channels_alike(material_)) {
    grid_ = make_march_grid(surface);
    const CellRect all{0, 0, surface.nx, surface.ny};
    tile_ = make_tile(surface, all, all, samples.refinement);
    context_.grid = &grid_;
    indirect_ = grid_.max_slope > 0 && max_order != 1;
    for (size_t c = 0; c < material.channels.size(); ++c)
        materials_.push_back(slot_material(material_, surface, tile_, c));
}

void GlossySky::start_run(int run) {
    const RunShifts shifts(seed_, 0, run);
    places_ = shifted_sub_samples(samples_.sub_samples, shifts(2), shifts(3));
    directions_ = sample_environment(sky_, n_directions_, shifts(40), shifts(41));
    arriving_.clear();
    arrived_.assign(n_channels(), 0.0);
    if (!indirect_) return;
    RunSettings settings;
    settings.directions = samples_.directions;
    settings.refinement = samples_.refinement;
    graph_ = run_pairs(context_, settings, tile_, shifts, options_.n_threads, monitor_);
    first_.assign(n_channels(), std::vector<float>(graph_.size(), 0.0f));
    rays_ += graph_.rays;
    pairs_ += static_cast<double>(graph_.size());
}

Radiances GlossySky::direct(const SubSample& place, const Receivers& receivers) {
    Radiances radiances(n_channels(), std::vector<float>(receivers.count, 0.0f));
    const double share = 1.0 / static_cast<double>(places_.size());
    // What a facet sees along a direction sends its light back along it.
    const bool lights_pairs = indirect_ && arriving_.empty();
    const Receivers pairs{
        lights_pairs ? graph_.size() : 0, [&](size_t first, size_t count, SeenParts& out) {
            for (size_t k = 0; k < count; ++k) {
                const uint32_t d = graph_.direction[first + k];
                out.set(k, graph_.seen[first + k],
                        {-graph_.directions.x[d], -graph_.directions.y[d], -graph_.directions.z[d]});
            }
        }};
    const auto& all = directions_.directions;
    for (size_t first = 0; first < all.size(); first += directions_together) {
        const auto begin = all.begin() + static_cast<long>(first);
        const std::vector<Vec3> some(
            begin, begin + static_cast<long>(std::min(directions_together, all.size() - first)));
        Lit lit;
        lit.directions = DirectionArrays(some);
        const VisibilityBits bits =
            find_visibility(grid_, tile_, some, {place}, options_.allow_skips, options_.n_threads, monitor_);
        rays_ += bits.rays;
        truncated_ += bits.truncated_bundles;
        add_cosines(tile_, some, bits, 1.0, options_.n_threads, lit.visible);
        for (size_t c = 0; c < n_channels(); ++c) {
            const auto from = directions_.light[c].begin() + static_cast<long>(first);
            lit.light.emplace_back(from, from + static_cast<long>(some.size()))
                .resize(lit.directions.padded(), 0.0f);
        }
        add_direct(lit, 1.0, receivers, radiances);
        if (!lights_pairs) continue;
        add_direct(lit, share, pairs, first_);
        const std::vector<float> ones(lit.directions.padded(), 1.0f);
        for (size_t u = 0; u < tile_.n_unknowns(); ++u) {
            const double area = tile_.sqrt_area[u % tile_.n_slots()] * tile_.sqrt_area[u % tile_.n_slots()];
            for (size_t c = 0; c < n_channels(); ++c)
                arrived_[c] += share * area *
                               dot_product(lit.visible.of(u), lit.light[c].data(), ones.data(), ones.size());
        }
    }
    return radiances;
}

void GlossySky::add_direct(const Lit& lit, double share, const Receivers& receivers, Radiances& to) {
    const size_t columns = lit.directions.padded();
    for_stretches(receivers, options_.n_threads, monitor_, [&](size_t first, size_t count, SeenParts& parts) {
        std::vector<uint32_t> slot(count);
        for (size_t k = 0; k < count; ++k)
            slot[k] = static_cast<uint32_t>(parts.unknown[k] % tile_.n_slots());
        std::vector<float> f(count * columns);
        for (const std::vector<size_t>& channels : alike_) {
            lobe_rows(materials_[channels[0]], tile_, count, slot.data(), parts.x.data(), parts.y.data(),
                      parts.z.data(), lit.directions, f.data());
            for (size_t k = 0; k < count; ++k) {
                if (cosine(tile_, slot[k], parts.x[k], parts.y[k], parts.z[k]) == 0) continue;
                for (const size_t c : channels)
                    to[c][first + k] += static_cast<float>(share) *
                                        dot_product(&f[k * columns], lit.visible.of(parts.unknown[k]),
                                                    lit.light[c].data(), columns);
            }
        }
    });
}

void GlossySky::sweep() {
    GraphOptions series;
    series.max_order = max_order_;
    for (const std::vector<size_t>& channels : alike_) {
        const size_t columns = padded(channels.size());
        FirstOrder first;
        first.radiance.resize(graph_.size() * columns);
        std::fill(first.radiance.begin(), first.radiance.end(), 0.0f);
        for (size_t k = 0; k < channels.size(); ++k) {
            first.arrived += arrived_[channels[k]];
            for (size_t e = 0; e < graph_.size(); ++e)
                first.radiance[e * columns + k] = first_[channels[k]][e];
        }
        GraphOrders found;
        arriving_.push_back(arriving_light(graph_, tile_, materials_[channels[0]], std::move(first), columns,
                                           series, options_.n_threads, monitor_, found));
        orders_ = std::max(orders_, found.n_orders);
        remainder_ = std::max(remainder_, found.remainder);
    }
}

Radiances GlossySky::indirect(const Receivers& receivers) {
    Radiances radiances(n_channels(), std::vector<float>(receivers.count, 0.0f));
    if (!indirect_) return radiances;
    if (arriving_.empty()) sweep();
    for_stretches(receivers, options_.n_threads, monitor_, [&](size_t first, size_t count, SeenParts& parts) {
        DirectionArrays from;
        std::vector<float> weights, f;
        for (size_t k = 0; k < count; ++k) {
            const uint32_t u = parts.unknown[k], slot = static_cast<uint32_t>(u % tile_.n_slots()),
                           begin = graph_.out[u];
            const size_t n = graph_.out[u + 1] - begin;
            if (n == 0 || cosine(tile_, slot, parts.x[k], parts.y[k], parts.z[k]) == 0) continue;
            for (auto* axis : {&from.x, &from.y, &from.z}) axis->assign(padded(n), 0.0f);
            weights.resize(n);
            for (size_t t = 0; t < n; ++t) {
                const uint32_t d = graph_.direction[begin + t];
                from.x[t] = graph_.directions.x[d], from.y[t] = graph_.directions.y[d],
                from.z[t] = graph_.directions.z[d];
                weights[t] = static_cast<float>(graph_.solid_angle) *
                             cosine(tile_, slot, from.x[t], from.y[t], from.z[t]);
            }
            from.n = static_cast<int>(n);
            f.resize(padded(n));
            for (size_t a = 0; a < alike_.size(); ++a) {
                const size_t columns = padded(alike_[a].size());
                lobe_rows(materials_[alike_[a][0]], tile_, 1, &slot, &parts.x[k], &parts.y[k], &parts.z[k],
                          from, f.data());
                for (size_t t = 0; t < n; ++t)
                    for (size_t c = 0; c < alike_[a].size(); ++c)
                        radiances[alike_[a][c]][first + k] +=
                            weights[t] * f[t] * arriving_[a][(begin + t) * columns + c];
            }
        }
    });
    return radiances;
}

std::vector<double> GlossySky::undersampled(const std::vector<Vec3>& views, int runs) const {
    std::vector<double> least(n_channels() * views.size(), 0.0);
    const NarrowLobes at_first = narrower_lobes(material_, 2 * pi / n_directions_),
                      beyond = indirect_ ? narrow_lobes(material_, grid_, tile_, samples_.directions)
                                         : NarrowLobes{};
    if (!at_first && !beyond) return least;
    // What a view receives of a uniform sky is what leaves of a light from there (reciprocity).
    LaterLight later;
    if (beyond)
        later =
            trace_later_light(surface_, material_, views, max_order_, seed_, options_.n_threads, monitor_);
    // Facets of a plane look all alike.
    const double facets = indirect_ ? static_cast<double>(tile_.n_unknowns()) : 1.0,
                 looks = facets * runs * static_cast<double>(places_.size()) * n_directions_;
    for (size_t c = 0; c < n_channels(); ++c)
        for (size_t v = 0; v < views.size(); ++v) {
            const double irradiance = horizontal_irradiance(sky_, static_cast<int>(c)),
                         first = at_first.share * reflected_share(material_) / pi /
                                 std::sqrt(1 + looks * at_first.solid_angle / (2 * pi));
            double orders = 0;
            if (beyond) {
                std::vector<double> chains = chains_of_pairs(
                    beyond, later[v][c], runs * static_cast<double>(graph_.size()), facets * runs);
                for (double& n : chains) n *= n_directions_;
                const double mean = std::accumulate(later[v][c].begin(), later[v][c].end(), 0.0) / pi;
                orders = gonio::undersampled(beyond, later[v][c], chains, 0, mean);
            }
            least[c * views.size() + v] = irradiance * std::hypot(first, orders);
        }
    return least;
}

void GlossySky::describe(int runs, Report& report) const {
    report.settings = {{"transport", "pair graph"},
                       {"runs", std::to_string(runs)},
                       {"directions", std::to_string(samples_.directions)},
                       {"sub_samples", std::to_string(samples_.sub_samples)},
                       {"refinement", std::to_string(samples_.refinement)},
                       {"orders", std::to_string(orders_ + 1)},
                       {"sky_directions", std::to_string(n_directions_)},
                       {"simd", simd_target()}};
    report.counters = {{"rays", rays_}, {"pairs", pairs_}, {"truncated_bundles", truncated_}};
    if ((indirect_ && narrow_lobes(material_, grid_, tile_, samples_.directions)) ||
        narrower_lobes(material_, 2 * pi / n_directions_))
        report.warnings.push_back(
            "the lobes are narrower than the shared directions are dense: single facets are rough, and what "
            "may be missed is in the errors; ask for more azimuths and directions");
}

}  // namespace gonio
