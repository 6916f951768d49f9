#include "measure/relight.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.h"
#include "base/parallel.h"
#include "measure/accuracy.h"
#include "measure/describe.h"
#include "measure/facet_light.h"
#include "measure/glossy_sky.h"
#include "measure/mesh_bias.h"
#include "measure/relit_runs.h"
#include "measure/run_limit.h"
#include "scattering/backward.h"
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

bool has_mirror(const Material& material) {
    return std::any_of(material.lobes.begin(), material.lobes.end(),
                       [](const WeightedLobe& part) { return std::holds_alternative<Mirror>(part.lobe); });
}

// Bytes at the peak: irradiance, the carried orders, the sum of each channel, views, the operator.
double peak_bytes(const HeightField& s, const Material& material, const RelightPlan& plan) {
    const Accuracy::Samples samples = samples_of(plan);
    const int n_channels = static_cast<int>(material.channels.size());
    const double views = static_cast<double>(plan.outgoing.size());
    const auto blocks = [](size_t n) {
        return static_cast<double>((n + column_block - 1) / column_block * column_block);
    };
    const double cells = static_cast<double>(s.nx) * s.ny,
                 unknowns = 2 * cells * samples.refinement * samples.refinement;
    if (has_mirror(material))
        return BackwardTracer::estimated_bytes(s) + 8 * unknowns * views +
               (24 * unknowns + 4 * cells) * views * n_channels;
    // Of each view and channel four times a float a part, their sum as a double; the images.
    if (!pure_lambertian(material))
        return GlossySky::run_bytes(s, samples, n_channels) + 24 * unknowns * views * n_channels +
               4 * cells * views * n_channels;
    return 4 * unknowns *
               (blocks(n_channels) * (5 + n_channels) + 2 * blocks(plan.outgoing.size()) + 4 * n_channels) +
           2 * cells * samples.directions * 0.35 * sizeof(Link) + 16 * cells * plan.azimuths +
           4.0 * n_channels * views * cells;
}

class Measurement {
  public:
    Measurement(const HeightField& surface, const Material& material, const Environment& environment,
                const RelightPlan& plan, const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          limit_(plan.accuracy, fewest_runs, most_runs),
          n_channels_(static_cast<int>(material.channels.size())),
          samples_(samples_of(plan)) {
        const double bytes = peak_bytes(surface, material, plan);
        if (bytes > static_cast<double>(options.max_bytes))
            throw Error(ErrorCode::limit, "/surface",
                        std::to_string(surface.nx) + " x " + std::to_string(surface.ny) + " points",
                        "need " + number(bytes / 1e9) + " GB under an environment, more than the " +
                            number(static_cast<double>(options.max_bytes) / 1e9) +
                            " GB of working memory: crop or resample the surface, or ask for fewer channels");
        for (const AnglesDeg& view : plan.outgoing) views_.push_back(to_vector(view));
        const auto make_runs = has_mirror(material)        ? mirror_relit_runs
                               : pure_lambertian(material) ? lambertian_relit_runs
                                                           : glossy_relit_runs;
        runs_ = make_runs(surface, material, environment, plan, samples_, options, monitor);
    }

    RelightResult run() {
        sums_.assign(n_channels_, std::vector<double>(runs_->layers() * runs_->tile().n_unknowns(), 0.0));
        squares_.assign(n_channels_, 0.0);
        while (limit_.wants_more(means_.count(), error_)) {
            monitor_.report(
                {limit_.fraction(means_.count()), "run " + std::to_string(means_.count() + 1), error_});
            add_run(means_.count());
            if (means_.count() >= 2) estimate_errors();
        }
        finish_facets();
        draw_images();
        describe();
        return std::move(result_);
    }

  private:
    void add_run(int run) {
        const RelitRun one = runs_->run(run);
        means_.add(one.means);
        const Tile& tile = runs_->tile();
        for (int c = 0; c < n_channels_; ++c)
            for (size_t k = 0; k < one.radiance[c].size(); ++k) {
                const double radiance = one.radiance[c][k];
                sums_[c][k] += radiance;
                squares_[c] += area_of(tile, k) * radiance * radiance;
            }
    }
    static double area_of(const Tile& tile, size_t unknown) {
        const float root = tile.sqrt_area[unknown % tile.n_slots()];
        return root * root;
    }

    void estimate_errors() {
        Relit& relit = result_.relit;
        const size_t n_views = views_.size();
        const RowGroups groups = view_groups(static_cast<int>(n_views));
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
        const Tile& tile = runs_->tile();
        const size_t n_unknowns = tile.n_unknowns(), layers = runs_->layers(), nx = surface_.nx;
        relit.n_facets = 2 * nx * surface_.ny * tile.n_parts();
        relit.radiance.resize(n_channels_ * layers * relit.n_facets);
        double area = 0;
        for (size_t u = 0; u < n_unknowns; ++u) area += area_of(tile, u);
        area *= static_cast<double>(layers);
        for (int c = 0; c < n_channels_; ++c) {
            double squares = 0;
            for (size_t k = 0; k < sums_[c].size(); ++k)
                squares += area_of(tile, k) * sums_[c][k] * sums_[c][k];
            const double variance = std::max(0.0, (squares_[c] - squares / runs) / (runs - 1)) / area;
            relit.radiance_se.push_back(std::sqrt(variance / runs));
            for (size_t layer = 0; layer < layers; ++layer)
                for (size_t facet = 0; facet < relit.n_facets; ++facet) {
                    const size_t unknown = facet / nx * tile.stride + facet % nx;  // whose rows are padded
                    relit.radiance[(c * layers + layer) * relit.n_facets + facet] =
                        static_cast<float>(sums_[c][layer * n_unknowns + unknown] / runs);
                }
        }
        const double mesh = runs_->evens_out_parts()
                                ? predict_mesh_bias(surface_).guess / std::pow(samples_.refinement, 2)
                                : 0.0,
                     relative = std::hypot(runs_->remainder(), mesh);
        const std::vector<double> doubts = runs_->doubts();
        for (size_t k = 0; k < relit.mean.size(); ++k)
            relit.bias.push_back(std::hypot(relative * relit.mean[k], doubts[k]));
        // What a mean misses its facets miss, too.
        for (int c = 0; c < n_channels_; ++c) {
            double squares = 0;
            for (size_t v = 0; v < views_.size(); ++v)
                squares += std::pow(doubts[c * views_.size() + v], 2) / static_cast<double>(views_.size());
            relit.radiance_se[c] = std::hypot(relit.radiance_se[c], std::sqrt(squares));
        }
    }

    void draw_images() {
        Relit& relit = result_.relit;
        const PixelGrid pixels = pixel_grid(surface_, plan_, runs_->grid());
        relit.pixels_x = pixels.nx, relit.pixels_y = pixels.ny;
        const size_t n_pixels = static_cast<size_t>(pixels.nx) * pixels.ny;
        relit.images.resize(n_pixels * views_.size() * n_channels_);
        std::vector<long long> unresolved(views_.size());
        parallel_for(relit.n_views, options_.n_threads, [&](int v) {
            monitor_.check_cancelled();
            const ViewMap map =
                make_view_map(runs_->grid(), views_[v], pixels, 0.5, 0.5, samples_.refinement);
            unresolved[v] = map.unresolved;
            const size_t layers = runs_->layers(), layer = layers > 1 ? v : 0;
            for (int c = 0; c < n_channels_; ++c)
                for (size_t p = 0; p < n_pixels; ++p)
                    relit.images[(static_cast<size_t>(v) * n_channels_ + c) * n_pixels + p] =
                        relit.radiance[(c * layers + layer) * relit.n_facets + map.facet[p]];
        });
        for (const long long n : unresolved) unresolved_ += static_cast<double>(n);
    }

    void describe() {
        Report& report = result_.report;
        report.relative_error = error_;
        report.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        runs_->describe(means_.count(), report);
        report.settings.emplace_back("azimuths", std::to_string(plan_.azimuths));
        report.counters.push_back({"view_rays_unresolved", unresolved_});
        report.seconds = {{"wall", limit_.seconds()}};
        if (unresolved_ > 0)
            report.warnings.push_back(number(unresolved_) +
                                      " view rays are so nearly horizontal that they were given up");
    }

    const HeightField& surface_;
    const RelightPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    RunLimit limit_;
    int n_channels_;
    Accuracy::Samples samples_;
    std::vector<Vec3> views_;
    std::unique_ptr<RelitRuns> runs_;
    RelightResult result_;
    Moments means_;                          // [channel][view]
    std::vector<std::vector<double>> sums_;  // radiance over the runs, as RelitRun::radiance
    std::vector<double> squares_;            // area times its squares, over parts and runs, [channel]
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

RowGroups view_groups(int n_views) {
    RowGroups groups;
    groups.n_lights = 1, groups.n_views = n_views;
    for (int v = 0; v < n_views; ++v) {
        groups.light.push_back(0);
        groups.view.push_back(v);
    }
    return groups;
}

void add_sent(const Tile& tile, const std::vector<std::vector<float>>& radiances, const VisibleCosines& seen,
              double share, int n_threads, std::vector<double>& sent) {
    const std::vector<float> area = core_areas(tile);
    const size_t n_views = sent.size() / radiances.size();
    parallel_for(static_cast<int>(sent.size()), n_threads, [&](int k) {
        const size_t v = k % n_views;
        const float* radiance = &radiances[k / n_views][v * tile.n_unknowns()];
        double sum = 0;
        for (size_t u = 0; u < tile.n_unknowns(); ++u)
            sum += static_cast<double>(area[u % tile.n_slots()]) * seen.of(u)[v] * radiance[u];
        sent[k] += share * sum;
    });
}

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
    const bool is_glossy = !pure_lambertian(material);
    prediction.cpu_seconds =
        0.05 + samples.replicates * facets *
                   (1e-6 * channels + 15e-9 * samples.directions +
                    samples.sub_samples * (80e-9 * plan.azimuths + 10e-9 * views * (1 + channels)));
    if (is_glossy)
        prediction.cpu_seconds =
            0.05 + samples.replicates * GlossySky::run_seconds(surface, samples, static_cast<int>(channels),
                                                               plan.azimuths, views * facets);
    if (has_mirror(material))
        prediction.cpu_seconds = 0.05 + samples.replicates * samples.sub_samples * views * facets * 1.2e-6;
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds);
    prediction.memory_bytes = (64 << 20) + peak_bytes(surface, material, plan);
    prediction.table_bytes = 4.0 * channels * ((is_glossy ? views : 1) * facets + views * facets / 2);
    return prediction;
}

}  // namespace gonio
