#include "measure/relight.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "measure/accuracy.h"
#include "measure/describe.h"
#include "measure/facet_light.h"
#include "measure/mesh_bias.h"
#include "scattering/environment_slices.h"
#include "visibility/view_map.h"

namespace gonio {
namespace {

constexpr int fewest_runs = 4, most_runs = 64;

Accuracy::Samples samples_of(const RelightPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{1, 64, 1, fewest_runs});
}

PixelGrid pixel_grid(const HeightField& s, const RelightPlan& plan, const MarchGrid& grid) {
    PixelGrid pixels;
    pixels.area = {s.border_x, s.border_y, s.nx - 2 * s.border_x, s.ny - 2 * s.border_y};
    pixels.nx = plan.pixels_x > 0 ? plan.pixels_x : pixels.area.width;
    pixels.ny = plan.pixels_y > 0 ? plan.pixels_y : pixels.area.height;
    pixels.plane_height = plan.plane == RelightPlan::Plane::top ? grid.highest * s.pitch_x : -s.mean_height;
    return pixels;
}

// Bytes at the peak: irradiance, the carried orders, the sum of each channel, views, the operator.
double peak_bytes(const HeightField& s, const RelightPlan& plan, int n_channels) {
    const Accuracy::Samples samples = samples_of(plan);
    const auto blocks = [](size_t n) {
        return static_cast<double>((n + column_block - 1) / column_block * column_block);
    };
    const double cells = static_cast<double>(s.nx) * s.ny,
                 unknowns = 2 * cells * samples.refinement * samples.refinement;
    return 4 * unknowns *
               (blocks(n_channels) * (5 + n_channels) + 2 * blocks(plan.outgoing.size()) + 4 * n_channels) +
           2 * cells * samples.directions * 0.35 * sizeof(Link) + 16 * cells * plan.azimuths +
           4.0 * n_channels * static_cast<double>(plan.outgoing.size()) * cells;
}

class Measurement {
  public:
    Measurement(const HeightField& surface, const Material& material, const Environment& environment,
                const RelightPlan& plan, const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          started_(std::chrono::steady_clock::now()),
          n_channels_(static_cast<int>(material.channels.size())),
          light_(surface, material, plan.max_order, samples_of(plan), plan.accuracy.seed, options, monitor),
          split_(split_key_lights(for_channels(environment, n_channels_))) {
        if (surface.base.is_curved())
            throw Error(ErrorCode::invalid_input, "/base", "",
                        "an environment lights flat bases only; a BRDF, BTF or maps know curved ones");
        const double bytes = peak_bytes(surface, plan, n_channels_);
        if (bytes > static_cast<double>(options.max_bytes))
            throw Error(ErrorCode::limit, "/surface",
                        std::to_string(surface.nx) + " x " + std::to_string(surface.ny) + " points",
                        "need " + number(bytes / 1e9) + " GB under an environment, more than the " +
                            number(static_cast<double>(options.max_bytes) / 1e9) +
                            " GB of working memory: crop or resample the surface, or ask for fewer channels");
        for (const AnglesDeg& view : plan.outgoing) views_.push_back(to_vector(view));
    }

    RelightResult run() {
        sums_.assign(n_channels_, std::vector<double>(light_.tile().n_unknowns(), 0.0));
        squares_.assign(n_channels_, 0.0);
        while (wants_more()) {
            monitor_.report({fraction(), "run " + std::to_string(means_.count() + 1), error_});
            add_run(means_.count());
            if (means_.count() >= 2) estimate_errors();
        }
        finish_facets();
        draw_images();
        describe();
        return std::move(result_);
    }

  private:
    bool wants_more() const {
        const int runs = means_.count();
        if (plan_.accuracy.samples) return runs < light_.samples().replicates;
        if (runs < fewest_runs) return true;
        if (plan_.accuracy.max_seconds && seconds() * (runs + 1) / runs > *plan_.accuracy.max_seconds)
            return false;
        return error_ > plan_.accuracy.target() && runs < most_runs;
    }
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
    }
    double fraction() const {
        const int planned =
            plan_.accuracy.samples ? light_.samples().replicates : std::max(fewest_runs, means_.count() + 1);
        return static_cast<double>(means_.count()) / planned;
    }
    double shift(int run, uint64_t which) const {
        constexpr uint64_t stream = uint64_t{1} << 32;  // FacetLight's runs use the streams below
        return uniform_double(random_words(plan_.accuracy.seed, stream + run, which)[0]);
    }

    // Irradiance at one place inside each facet part, [unknown][channel].
    Fields irradiance(int run, const SubSample& place) {
        SliceOptions slices;
        slices.azimuths = plan_.azimuths;
        slices.shift = shift(run, 0);
        Fields sum = sky_irradiance(light_.grid(), light_.unit_tile(), split_.sky, place, slices,
                                    options_.n_threads, monitor_);
        std::vector<Vec3> directions;
        for (const KeyLight& key : split_.key_lights) {
            const uint64_t k = directions.size();
            directions.push_back(direction_of(split_.sky, key, shift(run, 1 + 2 * k), shift(run, 2 + 2 * k)));
        }
        if (directions.empty()) return sum;
        const LightIrradiance keys = light_irradiance(light_.grid(), light_.unit_tile(), directions, {place},
                                                      options_.allow_skips, options_.n_threads, monitor_);
        for (size_t u = 0; u < sum.n_unknowns(); ++u)
            for (size_t k = 0; k < directions.size(); ++k) {
                const float lit = keys.lights.block(
                    static_cast<int>(k / column_block))[u * column_block + k % column_block];
                if (lit == 0) continue;
                for (int c = 0; c < n_channels_; ++c)
                    value(sum, u, c) += lit * static_cast<float>(split_.key_lights[k].irradiance[c]);
            }
        return sum;
    }
    static float& value(Fields& fields, size_t unknown, int column) {
        return fields.block(column / column_block)[unknown * column_block + column % column_block];
    }
    static float value(const Fields& fields, size_t unknown, int column) {
        return fields.block(column / column_block)[unknown * column_block + column % column_block];
    }

    // What the first order and the others send to the views. The first is formed place by place, for inside
    // a facet what is lit and what is seen are correlated; the others leave it evenly.
    void add_run(int run) {
        light_.start_run(run);
        const Tile& tile = light_.tile();
        const auto& places = light_.places();
        const double share = 1.0 / static_cast<double>(places.size());
        const size_t n_views = views_.size();
        std::vector<double> sent(n_channels_ * n_views, 0.0), projected(n_views, 0.0);
        Fields mean(tile.n_unknowns(), n_channels_), seen(tile.n_unknowns(), static_cast<int>(n_views));
        std::fill(mean.values().begin(), mean.values().end(), 0.0f);
        std::fill(seen.values().begin(), seen.values().end(), 0.0f);
        for (const SubSample& place : places) {
            const Fields direct = irradiance(run, place);
            const LightIrradiance views =
                light_irradiance(light_.grid(), light_.unit_tile(), views_, {place}, options_.allow_skips,
                                 options_.n_threads, monitor_);
            parallel_for(static_cast<int>(n_views), options_.n_threads, [&](int v) {
                for (size_t u = 0; u < tile.n_unknowns(); ++u) {
                    const double g = share * light_.area(u) * value(views.lights, u, v);
                    if (g == 0) continue;
                    projected[v] += g;
                    for (int c = 0; c < n_channels_; ++c)
                        sent[c * n_views + v] += g * light_.albedo_of(c, u) * value(direct, u, c);
                }
            });
            for (size_t k = 0; k < mean.values().size(); ++k)
                mean.values()[k] += static_cast<float>(share) * direct.values()[k];
            for (size_t k = 0; k < seen.values().size(); ++k)
                seen.values()[k] += static_cast<float>(share) * views.lights.values()[k];
        }
        const std::vector<Fields>& radiosity = light_.radiosity(mean);
        parallel_for(static_cast<int>(n_views), options_.n_threads, [&](int v) {
            for (size_t u = 0; u < tile.n_unknowns(); ++u) {
                const double g = light_.area(u) * value(seen, u, v);
                if (g == 0) continue;
                for (int c = 0; c < n_channels_; ++c)
                    sent[c * n_views + v] += g * (static_cast<double>(value(radiosity[c], u, c)) -
                                                  light_.albedo_of(c, u) * value(mean, u, c));
            }
        });
        std::vector<float> means(sent.size());
        for (int c = 0; c < n_channels_; ++c)
            for (size_t v = 0; v < n_views; ++v)
                means[c * n_views + v] =
                    projected[v] > 0 ? static_cast<float>(sent[c * n_views + v] / (pi * projected[v])) : 0.0f;
        means_.add(means);
        for (int c = 0; c < n_channels_; ++c)
            for (size_t u = 0; u < tile.n_unknowns(); ++u) {
                const double b = value(radiosity[c], u, c);
                sums_[c][u] += b;
                squares_[c] += light_.area(u) * b * b;
            }
    }

    void estimate_errors() {
        Relit& relit = result_.relit;
        const size_t n_views = views_.size();
        RowGroups groups;
        groups.n_lights = 1, groups.n_views = static_cast<int>(n_views);
        for (size_t v = 0; v < n_views; ++v) {
            groups.light.push_back(0);
            groups.view.push_back(static_cast<int>(v));
        }
        relit.mean = means_.mean();
        relit.se.clear();
        double total = 0;
        for (int c = 0; c < n_channels_; ++c) {
            const std::vector<double> se = standard_errors(means_, c * n_views, groups);
            const std::vector<double> scale =
                error_scale({relit.mean.begin() + static_cast<long>(c * n_views),
                             relit.mean.begin() + static_cast<long>((c + 1) * n_views)});
            for (size_t v = 0; v < n_views; ++v) {
                relit.se.push_back(se[v]);
                if (scale[v] > 0) total += std::pow(se[v] / scale[v], 2);
            }
        }
        error_ = std::sqrt(total / static_cast<double>(relit.se.size()));
    }

    void finish_facets() {
        Relit& relit = result_.relit;
        const int runs = means_.count();
        relit.n_channels = n_channels_;
        relit.n_views = static_cast<int>(views_.size());
        relit.n_facets = 2 * static_cast<size_t>(surface_.nx) * surface_.ny * light_.tile().n_parts();
        relit.radiance.resize(n_channels_ * relit.n_facets);
        double area = 0;
        for (size_t u = 0; u < light_.tile().n_unknowns(); ++u) area += light_.area(u);
        for (int c = 0; c < n_channels_; ++c) {
            double squares = 0;
            for (size_t u = 0; u < sums_[c].size(); ++u)
                squares += light_.area(u) * sums_[c][u] * sums_[c][u];
            const double variance = std::max(0.0, (squares_[c] - squares / runs) / (runs - 1)) / area;
            relit.radiance_se.push_back(std::sqrt(variance / runs) / pi);
            for (size_t facet = 0; facet < relit.n_facets; ++facet) {
                const size_t u = light_.unknown_of(facet);
                relit.radiance[c * relit.n_facets + facet] = static_cast<float>(sums_[c][u] / (pi * runs));
            }
        }
        const double mesh = predict_mesh_bias(surface_).guess / std::pow(light_.samples().refinement, 2),
                     relative = std::hypot(light_.remainder(), mesh);
        for (const double mean : relit.mean) relit.bias.push_back(relative * mean);
    }

    void draw_images() {
        Relit& relit = result_.relit;
        const PixelGrid pixels = pixel_grid(surface_, plan_, light_.grid());
        relit.pixels_x = pixels.nx, relit.pixels_y = pixels.ny;
        const size_t n_pixels = static_cast<size_t>(pixels.nx) * pixels.ny;
        relit.images.resize(n_pixels * views_.size() * n_channels_);
        std::vector<long long> unresolved(views_.size());
        parallel_for(relit.n_views, options_.n_threads, [&](int v) {
            monitor_.check_cancelled();
            const ViewMap map =
                make_view_map(light_.grid(), views_[v], pixels, 0.5, 0.5, light_.samples().refinement);
            unresolved[v] = map.unresolved;
            for (int c = 0; c < n_channels_; ++c)
                for (size_t p = 0; p < n_pixels; ++p)
                    relit.images[(static_cast<size_t>(v) * n_channels_ + c) * n_pixels + p] =
                        relit.radiance[c * relit.n_facets + map.facet[p]];
        });
        for (const long long n : unresolved) unresolved_ += static_cast<double>(n);
    }

    void describe() {
        Report& report = result_.report;
        report.relative_error = error_;
        report.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        light_.describe(means_.count(), report);
        report.settings.emplace_back("azimuths", std::to_string(plan_.azimuths));
        report.settings.emplace_back("key_lights", std::to_string(split_.key_lights.size()));
        report.counters.push_back({"view_rays_unresolved", unresolved_});
        report.seconds = {{"wall", seconds()}};
        if (unresolved_ > 0)
            report.warnings.push_back(number(unresolved_) +
                                      " view rays are so nearly horizontal that they were given up");
    }

    const HeightField& surface_;
    const RelightPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    std::chrono::steady_clock::time_point started_;
    int n_channels_;
    FacetLight light_;
    SplitEnvironment split_;
    std::vector<Vec3> views_;
    RelightResult result_;
    Moments means_;                          // [channel][view]
    std::vector<std::vector<double>> sums_;  // exitance over the runs, [channel][unknown]
    std::vector<double> squares_;            // area times their squares, over unknowns and runs, [channel]
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

RelightResult measure_relight(const HeightField& surface, const Material& material,
                              const Environment& environment, const RelightPlan& plan,
                              const RunOptions& options, const Monitor& monitor) {
    return Measurement(surface, material, environment, plan, options, monitor).run();
}

Prediction predict_relight(const HeightField& surface, const Material& material, const RelightPlan& plan) {
    const Accuracy::Samples samples = samples_of(plan);
    const double facets = 2.0 * surface.nx * surface.ny * samples.refinement * samples.refinement,
                 channels = static_cast<double>(material.channels.size()),
                 views = static_cast<double>(plan.outgoing.size());
    Prediction prediction;
    // Measured on 128 x 128 points.
    prediction.cpu_seconds =
        0.05 + samples.replicates * facets *
                   (1e-6 * channels + 15e-9 * samples.directions +
                    samples.sub_samples * (80e-9 * plan.azimuths + 10e-9 * views * (1 + channels)));
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds);
    prediction.memory_bytes =
        (64 << 20) + peak_bytes(surface, plan, static_cast<int>(material.channels.size()));
    prediction.table_bytes = 4.0 * channels * (facets + views * facets / 2);
    return prediction;
}

}  // namespace gonio
