#include "measure/glossy_pixels.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "measure/btf_views.h"
#include "measure/describe.h"
#include "scattering/turned_light.h"
#include "visibility/curvature.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr size_t light_block = 64;  // lights, or turned ones, that are swept through the graph together

void require_pictures(const Material& material) {
    for (const WeightedLobe& part : material.lobes)
        if (std::holds_alternative<Mirror>(part.lobe))
            throw Error(ErrorCode::invalid_input, "/material", "mirror",
                        "has no picture under a light from one direction: its radiance is infinite or 0; "
                        "needs a lobe of some width, as ggx");
}

// Of the middle of the facet on every slot.
std::vector<float> facet_heights(const HeightField& s, const Tile& tile) {
    std::vector<float> heights(tile.n_slots(), 0.0f);
    for (int kind = 0; kind < 2; ++kind)
        for (int j = 0; j < s.ny; ++j)
            for (int i = 0; i < s.nx; ++i)
                heights[tile.slot(kind, j, i)] =
                    (s.at(i, j) + (kind == 0 ? s.at(i + 1, j) : s.at(i, j + 1)) + s.at(i + 1, j + 1)) / 3;
    return heights;
}

}  // namespace

double glossy_run_bytes(const BtfShape& shape, const Accuracy::Samples& samples, const BaseCurvature& base) {
    const double unknowns = static_cast<double>(shape.n_facets), lights = (shape.n_lights + 15) / 16 * 16.0,
                 pairs = unknowns * samples.directions / (base.corrects_horizons() ? 1.0 : 9.0) * 0.35,
                 bits = 4 * unknowns * shape.n_lights;
    const int swept = std::min<int>(light_block, shape.n_lights * turned_coefficients(base));
    const double bends =
        base.is_curved() ? pairs * sizeof(PairBend) + 4 * unknowns * lights * turned_coefficients(base) : 0;
    return 4 * unknowns * lights + bits + bends + pairs * (20 + 4 * lights * shape.n_channels) +
           scatter_bytes(pairs, swept, 16);
}

GlossyPixels::GlossyPixels(const HeightField& surface, const Material& material, const BtfPlan& plan,
                           const Accuracy::Samples& samples, const RunOptions& options,
                           const Monitor& monitor)
    : surface_(surface),
      plan_(plan),
      samples_(samples),
      options_(options),
      monitor_(monitor),
      material_(simplified(material)) {
    check_base(surface);
    require_pictures(material);
    grid_ = make_march_grid(surface);
    const CellRect all{0, 0, surface.nx, surface.ny};
    tile_ = make_tile(surface, all, all, samples.refinement);
    context_.grid = &grid_;
    context_.indirect = grid_.max_slope > 0;
    for (size_t c = 0; c < material.channels.size(); ++c)
        materials_.push_back(slot_material(material_, surface, tile_, c));
    for (const AnglesDeg& light : plan.incident) lights_.push_back(to_vector(light));
    if (surface.base.is_curved()) lights_at_once_ = light_block / turned_coefficients(surface.base);
    for (size_t b = 0; b * lights_at_once_ < lights_.size(); ++b)
        light_blocks_.push_back(DirectionArrays(lights_of(b)));
    if (plan.cameras) cameras_ = camera_places(surface, plan);
    plane_height_ = view_plane_height(surface, plan);
    if (surface.base.is_curved()) facet_heights_ = facet_heights(surface, tile_);
    if (context_.indirect && plan.max_order != 1)
        narrow_ = narrow_lobes(material_, grid_, tile_, samples.directions);
    if (narrow_)
        later_ = trace_later_light(surface, material_, lights_, plan.max_order, plan.accuracy.seed,
                                   options.n_threads, monitor);
    run_bytes_ =
        glossy_run_bytes(btf_shape(surface, material, plan, samples.refinement), samples, surface.base);
}

double GlossyPixels::undersampled(size_t channel, size_t light, double found) const {
    if (!narrow_) return 0;
    const std::vector<double>& later = later_[light][channel];
    const double mean = std::accumulate(later.begin(), later.end(), 0.0) / pi;
    return gonio::undersampled(
        narrow_, later,
        chains_of_pairs(narrow_, later, pairs_, started_runs_ * static_cast<double>(tile_.n_unknowns())), 0,
        std::min(found, mean));
}

bool GlossyPixels::fits_another() const {
    return run_bytes_ * (n_runs() + 1) < static_cast<double>(options_.max_bytes);
}

void GlossyPixels::add_run() {
    if (!fits_another())
        throw Error(ErrorCode::limit, "/measure", number(run_bytes_ * (n_runs() + 1) / 1e9) + " GB",
                    "pictures of glossy facets need the light of all runs, more than the " +
                        number(static_cast<double>(options_.max_bytes) / 1e9) +
                        " GB of working memory: crop or resample the surface, or ask for fewer lights");
    const RunShifts shifts(plan_.accuracy.seed, 0, started_runs_++);
    Run run;
    const std::vector<SubSample> places = shifted_sub_samples(samples_.sub_samples, shifts(2), shifts(3));
    for (size_t first = 0; first < places.size(); first += most_bits) {
        const VisibilityBits bits =
            find_visibility(grid_, tile_, lights_,
                            {places.begin() + static_cast<long>(first),
                             places.begin() + static_cast<long>(std::min(places.size(), first + most_bits))},
                            options_.allow_skips, options_.n_threads, monitor_);
        rays_ += bits.rays;
        truncated_ += bits.truncated_bundles;
        add_cosines(tile_, lights_, bits, 1.0 / samples_.sub_samples, options_.n_threads, run.lit);
    }
    if (context_.indirect && plan_.max_order != 1) {
        RunSettings settings;
        settings.directions = samples_.directions;
        settings.refinement = samples_.refinement;
        run.graph = run_pairs(context_, settings, tile_, shifts, options_.n_threads, monitor_);
        rays_ += run.graph.rays;
        pairs_ += static_cast<double>(run.graph.size());
        std::optional<TurnNodes> nodes;
        if (surface_.base.is_curved()) nodes.emplace(surface_.base, turn_step(rms_turn(run.graph)));
        std::vector<TurnedLights> turned;
        for (size_t b = 0; nodes && b < light_blocks_.size(); ++b) {
            turned.push_back(turned_lights(grid_, tile_, lights_of(b), *nodes, places, options_.allow_skips,
                                           options_.n_threads, monitor_));
            rays_ += turned.back().rays;
        }
        GraphOptions series;
        series.max_order = plan_.max_order;
        for (const SlotMaterial& material : materials_) {
            auto& blocks = run.arriving.emplace_back();
            for (size_t b = 0; b < light_blocks_.size(); ++b) {
                GraphOrders found;
                const GraphSide lights = nodes
                                             ? GraphSide{turned[b].directions, &turned[b].visible, 0, &*nodes}
                                             : GraphSide{light_blocks_[b], &run.lit, b * lights_at_once_};
                blocks.push_back(arriving_light(run.graph, tile_, material, lights, series,
                                                options_.n_threads, monitor_, found));
                orders_ = std::max(orders_, found.n_orders);
                remainder_ = std::max(remainder_, found.remainder);
            }
        }
    }
    runs_.push_back(std::move(run));
}

std::vector<Vec3> GlossyPixels::lights_of(size_t block) const {
    const size_t first = block * lights_at_once_;
    return {lights_.begin() + static_cast<long>(first),
            lights_.begin() + static_cast<long>(std::min(lights_.size(), first + lights_at_once_))};
}

// The frame of the pixel, in which views are told, is not that of the facet that it shows.
Vec3 GlossyPixels::view_of(int view, size_t slot) const {
    const Vec3 d = to_vector(plan_.outgoing[view]);
    return surface_.base.is_curved() ? view_at_height(d, surface_.base, plane_height_, facet_heights_[slot])
                                     : d;
}

double GlossyPixels::indirect_irradiance(size_t unknown, size_t channel, size_t light) const {
    const Run& run = runs_.back();
    if (run.arriving.empty()) return 0;
    const size_t slot = unknown % tile_.n_slots(), block = light / lights_at_once_,
                 padded = light_blocks_[block].padded();
    double sum = 0;
    for (uint32_t e = run.graph.out[unknown]; e < run.graph.out[unknown + 1]; ++e) {
        const PairDirection d = run.graph.leaving(e);
        const float cosine =
            tile_.normal_x[slot] * d.x + tile_.normal_y[slot] * d.y + tile_.normal_z[slot] * d.z;
        sum += run.graph.solid_angle_of(e) * std::max(0.0f, cosine) *
               run.arriving[channel][block][e * padded + light % lights_at_once_];
    }
    return sum;
}

void GlossyPixels::add_pair_weights(const Run& run, int channel, const Vec3& view, const uint32_t* unknowns,
                                    size_t n, std::vector<float>& weights) const {
    std::vector<uint32_t> slot;
    std::vector<float> x, y, z, solid_angle;
    for (size_t k = 0; k < n; ++k)
        for (uint32_t e = run.graph.out[unknowns[k]]; e < run.graph.out[unknowns[k] + 1]; ++e) {
            const PairDirection d = run.graph.leaving(e);
            slot.push_back(static_cast<uint32_t>(unknowns[k] % tile_.n_slots()));
            x.push_back(d.x);
            y.push_back(d.y);
            z.push_back(d.z);
            solid_angle.push_back(run.graph.solid_angle_of(e));
        }
    const DirectionArrays to(std::vector<Vec3>{view});
    std::vector<float> f(slot.size() * to.padded());
    lobe_rows(materials_[channel], tile_, slot.size(), slot.data(), x.data(), y.data(), z.data(), to,
              f.data());
    for (size_t k = 0; k < slot.size(); ++k) {
        const float cosine =
            tile_.normal_x[slot[k]] * x[k] + tile_.normal_y[slot[k]] * y[k] + tile_.normal_z[slot[k]] * z[k];
        weights.push_back(f[k * to.padded()] * solid_angle[k] * std::max(0.0f, cosine));
    }
}

std::vector<float> GlossyPixels::values(const BtfShape& shape, const std::vector<uint32_t>& map, int view,
                                        int channel, size_t first, size_t count) const {
    const size_t n_lights = lights_.size(), row = surface_.nx;
    std::vector<float> values(runs_.size() * count * n_lights, 0.0f);
    std::vector<uint32_t> unknowns(count), slots(count);
    std::vector<float> x(count), y(count), z(count), f, weights, arrived(light_block);
    for (int s = 0; s < shape.pixel_samples; ++s) {
        for (size_t p = 0; p < count; ++p) {
            const uint32_t facet = map[s * shape.n_pixels() + first + p];
            unknowns[p] = static_cast<uint32_t>(facet / row * tile_.stride + facet % row);
            slots[p] = static_cast<uint32_t>(unknowns[p] % tile_.n_slots());
            const Vec3 d = plan_.cameras
                               ? pixel_to_camera(surface_, plane_height_, cameras_[view], shape, first + p)
                               : view_of(view, slots[p]);
            x[p] = static_cast<float>(d.x), y[p] = static_cast<float>(d.y), z[p] = static_cast<float>(d.z);
        }
        std::vector<std::vector<float>> pair_weights(runs_.size());
        for (size_t r = 0; r < runs_.size() && !runs_[r].arriving.empty(); ++r) {
            // Pixels of one direction together: all of a view, but for cameras and curved bases.
            const size_t together = plan_.cameras || surface_.base.is_curved() ? 1 : count;
            for (size_t p = 0; p < count; p += together)
                add_pair_weights(runs_[r], channel, {x[p], y[p], z[p]}, &unknowns[p], together,
                                 pair_weights[r]);
        }
        for (size_t b = 0; b < light_blocks_.size(); ++b) {
            const DirectionArrays& lights = light_blocks_[b];
            const size_t padded = lights.padded();
            f.resize(count * padded);
            lobe_rows(materials_[channel], tile_, count, slots.data(), x.data(), y.data(), z.data(), lights,
                      f.data());
            for (size_t r = 0; r < runs_.size(); ++r) {
                const Run& run = runs_[r];
                const float* weight = pair_weights[r].data();
                for (size_t p = 0; p < count; ++p) {
                    const float* lit = run.lit.of(unknowns[p]) + b * lights_at_once_;
                    float* to = &values[(r * count + p) * n_lights + b * lights_at_once_];
                    for (int l = 0; l < lights.n; ++l) to[l] += f[p * padded + l] * lit[l];
                    if (run.arriving.empty()) continue;
                    const uint32_t begin = run.graph.out[unknowns[p]],
                                   n = run.graph.out[unknowns[p] + 1] - begin;
                    if (n == 0) continue;
                    combine_rows(weight, n, &run.arriving[channel][b][begin * padded], padded, arrived.data(),
                                 nullptr);
                    weight += n;
                    for (int l = 0; l < lights.n; ++l) to[l] += arrived[l];
                }
            }
        }
    }
    for (size_t k = 0; k < values.size(); ++k)
        values[k] *= static_cast<float>(1 / (lights_[k % n_lights].z * shape.pixel_samples));
    return values;
}

void GlossyPixels::describe(Report& report) const {
    report.settings = {{"transport", "pair graph"},
                       {"runs", std::to_string(started_runs_)},
                       {"directions", std::to_string(samples_.directions)},
                       {"sub_samples", std::to_string(samples_.sub_samples)},
                       {"refinement", std::to_string(samples_.refinement)},
                       {"orders", std::to_string(orders_ + 1)},
                       {"simd", simd_target()}};
    report.counters = {{"rays", rays_}, {"pairs", pairs_}, {"truncated_bundles", truncated_}};
}

}  // namespace gonio
