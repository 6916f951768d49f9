#include "measure/glossy_btf.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/half.h"
#include "base/numeric.h"
#include "base/parallel.h"
#include "measure/accuracy.h"
#include "measure/btf_views.h"
#include "measure/describe.h"
#include "measure/glossy_pixels.h"
#include "measure/glossy_sky_pictures.h"
#include "measure/mesh_bias.h"
#include "measure/run_limit.h"

namespace gonio {
namespace {

constexpr int fewest_runs = 2, most_runs = 32, most_probes = 4, more_places = 4;

Accuracy::Samples samples_of(const BtfPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{4, 64, 1, fewest_runs});
}

// Of a view: sums over its pixels, [run][channel][light], and of squares of runs and of their sum.
struct ViewSums {
    std::vector<double> of_run;                // [run][channel][light]
    std::vector<double> squares, sum_squares;  // [channel][light]
};

class Measurement final : public GlossyPictures {
  public:
    Measurement(const HeightField& surface, const Material& material, const BtfPlan& plan,
                const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          channels_(material.channels),
          samples_(samples_of(plan)),
          shape_(btf_shape(surface, material, plan, samples_.refinement)),
          limit_(plan.accuracy, fewest_runs, most_runs, 0.5),
          pixels_(surface, material, plan, samples_, options, monitor),
          bent_grid_(bent_view_grid(surface, plan)) {
        for (int k = 0, n = std::min(most_probes, shape_.n_views); k < n; ++k)
            probes_.push_back(static_cast<int>((k + 0.5) * shape_.n_views / n));
        while (limit_.wants_more(pixels_.n_runs(), error_) && fits_another()) {
            monitor.report({0.5 * limit_.fraction(pixels_.n_runs()),
                            "run " + std::to_string(pixels_.n_runs() + 1), error_});
            pixels_.add_run();
            if (pixels_.n_runs() >= fewest_runs && !plan.accuracy.samples) judge();
        }
        compare_places();
        describe();
    }

    const BtfShape& shape() const override { return shape_; }
    const Report& report() const override { return report_; }

    Btf pictures(const OnView& on_view) override {
        const size_t n_lights = shape_.n_lights, n_views = shape_.n_views,
                     planes = shape_.n_channels * n_lights;
        std::vector<std::vector<float>> runs(pixels_.n_runs(), std::vector<float>(planes * n_views));
        std::vector<double> squares(planes), sum_squares(planes);
        std::vector<uint16_t> images(planes * shape_.n_pixels());
        for (int view = 0; view < shape_.n_views; ++view) {
            monitor_.report({0.5 + 0.5 * view / shape_.n_views, "pictures", error_});
            const ViewSums sums = of_view(shape_, view, pixel_centre, images);
            for (size_t p = 0; p < planes; ++p) {
                for (size_t r = 0; r < runs.size(); ++r)
                    runs[r][p * n_views + view] = static_cast<float>(sums.of_run[r * planes + p]);
                squares[p] += sums.squares[p];
                sum_squares[p] += sums.sum_squares[p];
            }
            on_view(view, images);
        }
        Btf btf;
        btf.shape = shape_;
        Table& mean = btf.mean;
        mean.channels = channels_;
        mean.incident = plan_.incident;
        mean.outgoing = view_angles(surface_, plan_);
        const Moments moments = moments_of(runs);
        const RowGroups groups = row_groups(shape_.n_views);
        mean.f.assign(moments.mean().begin(), moments.mean().end());
        for (int c = 0; c < shape_.n_channels; ++c)
            for (const double se : standard_errors(moments, c * n_lights * n_views, groups))
                mean.se.push_back(static_cast<float>(se));
        const double mesh = predict_mesh_bias(surface_).guess / std::pow(samples_.refinement, 2),
                     left = std::hypot(mesh, pixels_.remainder());
        std::vector<double> rare(planes);  // mean square over the views
        for (size_t p = 0; p < planes; ++p) {
            for (size_t v = 0; v < n_views; ++v) {
                const size_t k = p * n_views + v;
                const double least = pixels_.undersampled(p / n_lights, p % n_lights, mean.f[k]);
                // What the scatter tells already is not told twice (see GraphTransport::add_rare).
                const double missed = safe_sqrt(least * least - 2.0 * mean.se[k] * mean.se[k]);
                mean.bias.push_back(
                    static_cast<float>(std::hypot(mean.f[k] * std::hypot(left, places_[p]), missed)));
                rare[p] += missed * missed / static_cast<double>(n_views);
            }
        }
        const double n = static_cast<double>(runs.size());
        // What a mean misses its pixels miss, too.
        for (size_t p = 0; p < planes; ++p)
            btf.pixel_se.push_back(std::sqrt(std::max(0.0, squares[p] - sum_squares[p] / n) / (n - 1) / n /
                                                 static_cast<double>(n_views * shape_.n_pixels()) +
                                             rare[p]));
        return btf;
    }

  private:
    // Runs that are asked for, or needed for any error, are made whatever they take.
    bool fits_another() const {
        return plan_.accuracy.samples || pixels_.n_runs() < fewest_runs || pixels_.fits_another();
    }

    // images: [light][channel][pixel] of the view, or empty if they are not wanted.
    ViewSums of_view(const BtfShape& shape, int view, const SubSample& place, std::span<uint16_t> images) {
        const std::vector<uint32_t> map =
            make_view_maps(surface_, bent_grid_ ? *bent_grid_ : pixels_.grid(), plan_, shape, {view}, place,
                           samples_.refinement, options_.n_threads, monitor_, unresolved_);
        const size_t n_lights = shape.n_lights, planes = shape.n_channels * n_lights, runs = pixels_.n_runs(),
                     n_pixels = shape.n_pixels();
        constexpr size_t chunk = 256;
        const int n_chunks = static_cast<int>((n_pixels + chunk - 1) / chunk);
        std::vector<ViewSums> partial(n_chunks);
        parallel_for(n_chunks, options_.n_threads, [&](int k) {
            monitor_.check_cancelled();
            const size_t first = k * chunk, count = std::min(chunk, n_pixels - first);
            ViewSums& sums = partial[k];
            sums.of_run.assign(runs * planes, 0.0);
            sums.squares.assign(planes, 0.0);
            sums.sum_squares.assign(planes, 0.0);
            for (int c = 0; c < shape.n_channels; ++c) {
                // [run][pixel][light]
                const std::vector<float> values = pixels_.values(shape, map, view, c, first, count);
                for (size_t p = 0; p < count; ++p)
                    for (size_t l = 0; l < n_lights; ++l) {
                        double total = 0;
                        for (size_t r = 0; r < runs; ++r) {
                            const double value = values[(r * count + p) * n_lights + l];
                            sums.of_run[r * planes + c * n_lights + l] += value;
                            sums.squares[c * n_lights + l] += value * value;
                            total += value;
                        }
                        sums.sum_squares[c * n_lights + l] += total * total;
                        if (!images.empty())
                            images[(l * shape.n_channels + c) * n_pixels + first + p] =
                                half_bits(static_cast<float>(total / static_cast<double>(runs)));
                    }
            }
        });
        ViewSums sums = std::move(partial[0]);
        const auto add = [](const std::vector<double>& from, std::vector<double>& to) {
            for (size_t k = 0; k < to.size(); ++k) to[k] += from[k];
        };
        for (int k = 1; k < n_chunks; ++k) {
            add(partial[k].of_run, sums.of_run);
            add(partial[k].squares, sums.squares);
            add(partial[k].sum_squares, sums.sum_squares);
        }
        for (double& sum : sums.of_run) sum /= static_cast<double>(n_pixels);
        return sums;
    }

    // [channel][light][view] of every run.
    static Moments moments_of(const std::vector<std::vector<float>>& runs) {
        Moments moments;
        for (const std::vector<float>& run : runs) moments.add(run);
        return moments;
    }
    RowGroups row_groups(int n_views) const {
        RowGroups groups;
        groups.n_lights = shape_.n_lights;
        groups.n_views = n_views;
        for (int l = 0; l < shape_.n_lights; ++l)
            for (int v = 0; v < n_views; ++v) {
                groups.light.push_back(l);
                groups.view.push_back(v);
            }
        return groups;
    }

    // Error of the means of a few views, of the runs so far.
    void judge() {
        const size_t planes = static_cast<size_t>(shape_.n_channels) * shape_.n_lights, n = probes_.size();
        std::vector<std::vector<float>> runs(pixels_.n_runs(), std::vector<float>(planes * n));
        for (size_t k = 0; k < n; ++k) {
            const ViewSums sums = of_view(shape_, probes_[k], pixel_centre, {});
            for (size_t r = 0; r < runs.size(); ++r)
                for (size_t p = 0; p < planes; ++p)
                    runs[r][p * n + k] = static_cast<float>(sums.of_run[r * planes + p]);
        }
        const Moments moments = moments_of(runs);
        const size_t rows = shape_.n_lights * n;
        double total = 0;
        for (int c = 0; c < shape_.n_channels; ++c) {
            const auto begin = moments.mean().begin() + static_cast<long>(c * rows);
            const std::vector<double> se =
                                          standard_errors(moments, c * rows, row_groups(static_cast<int>(n))),
                                      scale = error_scale({begin, begin + static_cast<long>(rows)});
            for (size_t r = 0; r < rows; ++r)
                if (scale[r] > 0) total += std::pow(se[r] / scale[r], 2);
        }
        error_ = std::sqrt(total / static_cast<double>(planes * n));
    }

    // What the places of the pixels may do to means, relative, [channel][light]: see PixelMeans.
    void compare_places() {
        BtfShape more = shape_;
        more.pixel_samples *= more_places;
        const size_t planes = static_cast<size_t>(shape_.n_channels) * shape_.n_lights;
        places_.assign(planes, 0.0);
        for (const int view : probes_) {
            const ViewSums here = of_view(shape_, view, pixel_centre, {}),
                           there = of_view(more, view, {0.81, 0.67}, {});
            for (size_t p = 0; p < planes; ++p)
                if (here.of_run[p] > 0)
                    places_[p] += std::pow(there.of_run[p] / here.of_run[p] - 1, 2) /
                                  ((1 + 1.0 / more_places) * static_cast<double>(probes_.size()));
        }
        for (double& place : places_) place = std::sqrt(place);
    }

    void describe() {
        judge();
        report_.relative_error = error_;
        report_.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        pixels_.describe(report_);
        report_.counters.push_back({"view_rays_unresolved", unresolved_});
        report_.seconds = {{"wall", limit_.seconds()}};
        if (pixels_.has_narrow_lobes())
            report_.warnings.push_back(
                "the lobes are narrower than the shared directions are dense: orders 2 and up of single "
                "pixels are rough, and what may be missed is in the bias and in pixel_se; ask for more "
                "directions");
    }

    const HeightField& surface_;
    const BtfPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    const std::vector<std::string>& channels_;
    Accuracy::Samples samples_;
    BtfShape shape_;
    RunLimit limit_;
    GlossyPixels pixels_;
    std::optional<MarchGrid> bent_grid_;
    std::vector<int> probes_;  // views that are judged by
    std::vector<double> places_;
    Report report_;
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

GlossyBtf::GlossyBtf(const HeightField& surface, const Material& material, const BtfPlan& plan,
                     const RunOptions& options, const Monitor& monitor, const Environment* environment)
    : pictures_(environment ? glossy_sky_pictures(surface, material, plan, *environment, options, monitor)
                            : std::make_unique<Measurement>(surface, material, plan, options, monitor)) {}

Prediction predict_glossy_btf(const HeightField& surface, const Material& material, const BtfPlan& plan) {
    if (plan.incident.empty()) return predict_sky_pictures(surface, material, plan);
    const Accuracy::Samples samples = samples_of(plan);
    const BtfShape shape = btf_shape(surface, material, plan, samples.refinement);
    const double facets = static_cast<double>(shape.n_facets), lights = shape.n_lights,
                 channels = shape.n_channels,
                 seen = static_cast<double>(shape.images_size()) * shape.pixel_samples;
    Prediction prediction;
    // Measured on 128 x 128 points, 16 lights and views, GGX.
    prediction.cpu_seconds =
        0.05 + seen * (5e-9 + 4e-9 * samples.replicates) +
        samples.replicates * facets *
            (1e-6 + 20e-9 * lights * samples.sub_samples + 2e-9 * channels * lights * samples.directions);
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds);
    prediction.memory_bytes = (64 << 20) +
                              samples.replicates * glossy_run_bytes(shape, samples, surface.base) +
                              2.0 * static_cast<double>(shape.images_size()) / shape.n_views;
    prediction.table_bytes = 2.0 * static_cast<double>(shape.images_size());
    return prediction;
}

}  // namespace gonio
