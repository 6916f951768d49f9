#include "measure/glossy_sky_pictures.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/half.h"
#include "measure/accuracy.h"
#include "measure/btf_views.h"
#include "measure/describe.h"
#include "measure/glossy_sky.h"
#include "measure/mesh_bias.h"
#include "measure/relit_runs.h"
#include "measure/run_limit.h"

namespace gonio {
namespace {

constexpr int fewest_runs = 4, most_runs = 64, most_probes = 4, more_places = 4;

class SkyPictures final : public GlossyPictures {
  public:
    SkyPictures(const HeightField& surface, const Material& material, const BtfPlan& plan,
                const Environment& environment, const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          limit_(plan.accuracy, fewest_runs, most_runs),
          samples_(sky_pictures_samples(plan)),
          shape_(btf_shape(surface, material, plan, samples_.refinement)) {
        require_memory();
        sky_ = std::make_unique<GlossySky>(
            surface, material, with_unit_irradiance(for_channels(environment, shape_.n_channels)),
            plan.azimuths, plan.max_order, samples_, plan.accuracy.seed, options, monitor);
        if (plan.cameras) cameras_ = camera_places(surface, plan);
        std::vector<int> all(shape_.n_views);
        std::iota(all.begin(), all.end(), 0);
        maps_ = view_maps(shape_, all, pixel_centre);
        sums_.assign(shape_.n_channels, std::vector<float>(shape_.n_views * shape_.n_pixels(), 0.0f));
        squares_.assign(shape_.n_channels, 0.0);
        while (limit_.wants_more(means_.count(), error_)) {
            monitor.report(
                {limit_.fraction(means_.count()), "run " + std::to_string(means_.count() + 1), error_});
            add_run();
        }
        describe(material);
    }

    const BtfShape& shape() const override { return shape_; }
    const Report& report() const override { return report_; }

    Btf pictures(const OnView& on_view) override {
        const size_t n = shape_.n_pixels(), n_channels = shape_.n_channels;
        const double runs = means_.count();
        std::vector<uint16_t> images(n_channels * n);
        for (int view = 0; view < shape_.n_views; ++view) {
            for (size_t c = 0; c < n_channels; ++c)
                for (size_t p = 0; p < n; ++p)
                    images[c * n + p] = half_bits(static_cast<float>(sums_[c][view * n + p] / runs));
            on_view(view, images);
        }
        return btf_;
    }

  private:
    void require_memory() const {
        const double bytes = sky_pictures_bytes(surface_, shape_, samples_);
        if (bytes > static_cast<double>(options_.max_bytes))
            throw Error(
                ErrorCode::limit, "/measure", number(bytes / 1e9) + " GB",
                "pictures of glossy facets under an environment are kept until all runs are made, more "
                "than the " +
                    number(static_cast<double>(options_.max_bytes) / 1e9) +
                    " GB of working memory: ask for fewer views or pixels");
    }

    std::vector<uint32_t> view_maps(const BtfShape& shape, const std::vector<int>& views,
                                    const SubSample& place) {
        return make_view_maps(surface_, sky_->grid(), plan_, shape, views, place, samples_.refinement,
                              options_.n_threads, monitor_, unresolved_);
    }

    // Of the run that was started: a value for every pixel, [channel][view of the list][pixel].
    Radiances values(const BtfShape& shape, const std::vector<int>& views,
                     const std::vector<uint32_t>& maps) {
        const size_t n = shape.n_pixels(), places = shape.pixel_samples * n, row = surface_.nx;
        const Receivers receivers{
            views.size() * places, [&](size_t first, size_t count, SeenParts& out) {
                for (size_t k = 0; k < count; ++k) {
                    const size_t at = first + k, facet = maps[at];
                    const int view = views[at / places];
                    out.set(k, facet / row * sky_->tile().stride + facet % row,
                            plan_.cameras
                                ? pixel_to_camera(surface_, plane_height_, cameras_[view], shape, at % n)
                                : to_vector(plan_.outgoing[view]));
                }
            }};
        Radiances pixels(shape.n_channels, std::vector<float>(views.size() * n, 0.0f));
        const auto add = [&](const Radiances& radiances, double share) {
            for (size_t c = 0; c < radiances.size(); ++c)
                for (size_t k = 0; k < receivers.count; ++k)
                    pixels[c][k / places * n + k % n] += static_cast<float>(share) * radiances[c][k];
        };
        const double share = 1.0 / shape.pixel_samples;
        for (const SubSample& place : sky_->places())
            add(sky_->direct(place, receivers), share / static_cast<double>(sky_->places().size()));
        add(sky_->indirect(receivers), share);
        return pixels;
    }
    // Over the pixels, [channel][view].
    static std::vector<float> means_of(const Radiances& pixels, size_t n_pixels) {
        std::vector<float> means;
        for (const std::vector<float>& channel : pixels)
            for (size_t first = 0; first < channel.size(); first += n_pixels)
                means.push_back(
                    static_cast<float>(std::accumulate(&channel[first], &channel[first] + n_pixels, 0.0) /
                                       static_cast<double>(n_pixels)));
        return means;
    }

    void add_run() {
        sky_->start_run(means_.count());
        std::vector<int> all(shape_.n_views);
        std::iota(all.begin(), all.end(), 0);
        const Radiances pixels = values(shape_, all, maps_);
        const std::vector<float> means = means_of(pixels, shape_.n_pixels());
        means_.add(means);
        for (size_t c = 0; c < pixels.size(); ++c)
            for (size_t k = 0; k < pixels[c].size(); ++k) {
                sums_[c][k] += pixels[c][k];
                squares_[c] += static_cast<double>(pixels[c][k]) * pixels[c][k];
            }
        if (means_.count() == 1) look_at_other_places(means);
        if (means_.count() >= 2) estimate_errors();
    }

    // A few views once more with more rays through the pixels, under the same light: see PixelMeans. For this
    // the run starts anew, for the first order goes over its pairs once.
    void look_at_other_places(const std::vector<float>& means) {
        BtfShape more = shape_;
        more.pixel_samples *= more_places;
        std::vector<int> probes;
        for (int k = 0, n = std::min(most_probes, shape_.n_views); k < n; ++k)
            probes.push_back(static_cast<int>((k + 0.5) * shape_.n_views / n));
        sky_->start_run(0);
        const std::vector<float> there =
            means_of(values(more, probes, view_maps(more, probes, {0.81, 0.67})), more.n_pixels());
        for (int c = 0; c < shape_.n_channels; ++c) {
            double squares = 0;
            for (size_t k = 0; k < probes.size(); ++k)
                if (const float here = means[c * shape_.n_views + probes[k]]; here > 0)
                    squares += std::pow(there[c * probes.size() + k] / here - 1, 2);
            pixel_places_.push_back(
                std::sqrt(squares / ((1 + 1.0 / more_places) * static_cast<double>(probes.size()))));
        }
    }

    void estimate_errors() {
        Table& mean = btf_.mean;
        mean.f.assign(means_.mean().begin(), means_.mean().end());
        mean.se.clear();
        const size_t n_views = shape_.n_views;
        double total = 0;
        for (int c = 0; c < shape_.n_channels; ++c) {
            const auto begin = means_.mean().begin() + static_cast<long>(c * n_views);
            const std::vector<double> scale = error_scale({begin, begin + static_cast<long>(n_views)}),
                                      se = standard_errors(means_, c * n_views, view_groups(shape_.n_views));
            for (size_t v = 0; v < n_views; ++v) {
                mean.se.push_back(static_cast<float>(se[v]));
                if (scale[v] > 0) total += std::pow(se[v] / scale[v], 2);
            }
        }
        error_ = std::sqrt(total / static_cast<double>(mean.se.size()));
    }

    void describe(const Material& material) {
        btf_.shape = shape_;
        btf_.mean.channels = material.channels;
        btf_.mean.outgoing = view_angles(surface_, plan_);
        const double mesh = predict_mesh_bias(surface_).guess / std::pow(samples_.refinement, 2),
                     runs = means_.count(),
                     pixels = static_cast<double>(shape_.n_views) * static_cast<double>(shape_.n_pixels());
        for (int c = 0; c < shape_.n_channels; ++c) {
            for (int v = 0; v < shape_.n_views; ++v)
                btf_.mean.bias.push_back(
                    static_cast<float>(btf_.mean.f[c * shape_.n_views + v] *
                                       std::hypot(mesh, sky_->remainder(), pixel_places_[c])));
            double squares = 0;
            for (const float sum : sums_[c]) squares += static_cast<double>(sum) * sum;
            btf_.pixel_se.push_back(
                std::sqrt(std::max(0.0, squares_[c] - squares / runs) / (runs - 1) / runs / pixels));
        }
        report_.relative_error = error_;
        report_.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        sky_->describe(means_.count(), report_);
        report_.counters.push_back({"view_rays_unresolved", unresolved_});
        report_.seconds = {{"wall", limit_.seconds()}};
    }

    const HeightField& surface_;
    const BtfPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    RunLimit limit_;
    Accuracy::Samples samples_;
    BtfShape shape_;
    std::unique_ptr<GlossySky> sky_;
    std::vector<Vec3> cameras_;
    double plane_height_ = view_plane_height(surface_, plan_);
    std::vector<uint32_t> maps_;
    Moments means_;                         // [channel][view]
    std::vector<std::vector<float>> sums_;  // over the runs, [channel][view][pixel]
    std::vector<double> squares_;           // over pixels and runs, [channel]
    std::vector<double> pixel_places_;      // what they do to means, relative, [channel]
    Btf btf_;
    Report report_;
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

Accuracy::Samples sky_pictures_samples(const BtfPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{1, 64, 1, fewest_runs});
}

// Of every place a map entry, of it and channel two values of a run; of every pixel sum and value.
double sky_pictures_bytes(const HeightField& surface, const BtfShape& shape,
                          const Accuracy::Samples& samples) {
    const double places = static_cast<double>(shape.maps_size()),
                 pixels = static_cast<double>(shape.n_views) * static_cast<double>(shape.n_pixels());
    return GlossySky::run_bytes(surface, samples, shape.n_channels) + places * (4 + 8.0 * shape.n_channels) +
           pixels * 8.0 * shape.n_channels;
}

std::unique_ptr<GlossyPictures> glossy_sky_pictures(const HeightField& surface, const Material& material,
                                                    const BtfPlan& plan, const Environment& environment,
                                                    const RunOptions& options, const Monitor& monitor) {
    return std::make_unique<SkyPictures>(surface, material, plan, environment, options, monitor);
}

}  // namespace gonio
