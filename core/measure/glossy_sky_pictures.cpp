#include "measure/glossy_sky_pictures.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/half.h"
#include "base/numeric.h"
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

Accuracy::Samples samples_of(const BtfPlan& plan) {
    return plan.accuracy.samples.value_or(Accuracy::Samples{1, 64, 1, fewest_runs});
}

// A few views, evenly among all.
std::vector<int> probes_of(const BtfShape& shape) {
    std::vector<int> probes;
    for (int k = 0, n = std::min(most_probes, shape.n_views); k < n; ++k)
        probes.push_back(static_cast<int>((k + 0.5) * shape.n_views / n));
    return probes;
}

// How views are cut into blocks. Of all in one block the runs that judge the error are those that are shown;
// else a few views judge, and then the runs are made again for every block.
struct Cut {
    int views = 0, blocks = 0;         // views of a block
    double bytes = 0;                  // at the peak
    double judging = 0, pictures = 0;  // CPU seconds of a run
};
Cut cut_views(const HeightField& surface, const BtfShape& shape, const Accuracy::Samples& samples,
              int azimuths, double max_bytes) {
    // Every place of a pixel has a map entry, and of each channel two values of a run; every pixel its value
    // and the sum of the runs.
    const auto view_bytes = [&](int places) {
        return static_cast<double>(shape.n_pixels()) *
               (places * (4.0 + 8.0 * shape.n_channels) + 8.0 * shape.n_channels);
    };
    const auto seconds = [&](int views) {
        return GlossySky::run_seconds(
            surface, samples, shape.n_channels, azimuths,
            static_cast<double>(views) * shape.pixel_samples * static_cast<double>(shape.n_pixels()));
    };
    const int probes = static_cast<int>(probes_of(shape).size()), places = shape.pixel_samples;
    const double always = GlossySky::run_bytes(surface, samples, shape.n_channels) +
                          probes * (view_bytes(places) + view_bytes(more_places * places));
    Cut cut;
    cut.views =
        static_cast<int>(std::clamp((max_bytes - always) / view_bytes(places), 1.0, shape.n_views * 1.0));
    cut.blocks = (shape.n_views + cut.views - 1) / cut.views;
    cut.bytes = always + cut.views * view_bytes(places);
    cut.judging = seconds(cut.blocks == 1 ? shape.n_views : probes);
    if (cut.blocks > 1)
        cut.pictures = (cut.blocks - 1) * seconds(0) + seconds(shape.n_views);  // its light anew in each
    return cut;
}

class SkyPictures final : public GlossyPictures {
  public:
    SkyPictures(const HeightField& surface, const Material& material, const BtfPlan& plan,
                const Environment& environment, const RunOptions& options, const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          options_(options),
          monitor_(monitor),
          channels_(material.channels),
          samples_(samples_of(plan)),
          shape_(btf_shape(surface, material, plan, samples_.refinement)),
          cut_(cut_views(surface, shape_, samples_, plan.azimuths, static_cast<double>(options.max_bytes))),
          judging_share_(cut_.judging / (cut_.judging + cut_.pictures)),
          limit_(plan.accuracy, fewest_runs, most_runs, judging_share_),
          probes_(probes_of(shape_)) {
        require_memory();
        sky_ = std::make_unique<GlossySky>(
            surface, material, with_unit_irradiance(for_channels(environment, shape_.n_channels)),
            plan.azimuths, plan.max_order, samples_, plan.accuracy.seed, options, monitor);
        if (plan.cameras) cameras_ = camera_places(surface, plan);
        judged_ = block_of(cut_.blocks == 1 ? views_from(0) : probes_);
        while (limit_.wants_more(n_runs(), error_)) {
            monitor.report(
                {judging_share_ * limit_.fraction(n_runs()), "run " + std::to_string(n_runs() + 1), error_});
            sky_->start_run(n_runs());
            add_run(judged_);
            judge();
        }
        describe();
    }

    const BtfShape& shape() const override { return shape_; }
    const Report& report() const override { return report_; }

    Btf pictures(const OnView& on_view) override {
        const size_t n = shape_.n_pixels(), n_channels = shape_.n_channels, n_views = shape_.n_views;
        std::vector<std::vector<float>> means(n_runs(), std::vector<float>(n_channels * n_views));
        std::vector<double> squares(n_channels), sum_squares(n_channels);
        std::vector<uint16_t> images(n_channels * n);
        Block made;
        for (int first = 0; first < shape_.n_views; first += cut_.views) {
            made = {};
            if (cut_.blocks > 1) made = measured(first);
            const Block& block = cut_.blocks > 1 ? made : judged_;
            for (size_t k = 0; k < block.views.size(); ++k) {
                for (size_t c = 0; c < n_channels; ++c) {
                    squares[c] += block.squares[c][k];
                    for (size_t p = 0; p < n; ++p) {
                        const float sum = block.sums[c][k * n + p];
                        sum_squares[c] += static_cast<double>(sum) * sum;
                        images[c * n + p] = half_bits(static_cast<float>(sum / double(n_runs())));
                    }
                    for (int run = 0; run < n_runs(); ++run)
                        means[run][c * n_views + first + k] = block.means[run][c * block.views.size() + k];
                }
                on_view(block.views[k], images);
            }
        }
        describe();  // what all blocks took
        return with_errors(means, squares, sum_squares);
    }

  private:
    // Views under the light of some runs.
    struct Block {
        std::vector<int> views;
        std::vector<uint32_t> maps;
        Radiances sums;                            // over the runs, [channel][view][pixel]
        std::vector<std::vector<double>> squares;  // over the runs and pixels, [channel][view]
        std::vector<std::vector<float>> means;     // over the pixels, [run][channel][view]
    };

    int n_runs() const { return static_cast<int>(judged_.means.size()); }

    void require_memory() const {
        if (cut_.bytes > static_cast<double>(options_.max_bytes))
            throw Error(ErrorCode::limit, "/measure", number(cut_.bytes / 1e9) + " GB",
                        "the light of a run and the picture of a view, of glossy facets under an "
                        "environment, are more than the " +
                            number(static_cast<double>(options_.max_bytes) / 1e9) +
                            " GB of working memory: ask for fewer pixels or samples, or resample the "
                            "surface");
    }

    std::vector<int> views_from(int first) const {
        std::vector<int> views(std::min(cut_.views, shape_.n_views - first));
        std::iota(views.begin(), views.end(), first);
        return views;
    }

    Block block_of(const std::vector<int>& views) {
        Block block{views, view_maps(shape_, views, pixel_centre), {}, {}, {}};
        block.sums.assign(shape_.n_channels, std::vector<float>(views.size() * shape_.n_pixels(), 0.0f));
        block.squares.assign(shape_.n_channels, std::vector<double>(views.size(), 0.0));
        return block;
    }

    Block measured(int first) {
        Block block = block_of(views_from(first));
        for (int run = 0; run < n_runs(); ++run) {
            const double done = (first + double(block.views.size()) * run / n_runs()) / shape_.n_views;
            monitor_.report({judging_share_ + (1 - judging_share_) * done, "pictures", error_});
            sky_->start_run(run);
            add_run(block);
        }
        return block;
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

    // Adds the run that was started.
    void add_run(Block& block) {
        const Radiances pixels = values(shape_, block.views, block.maps);
        block.means.push_back(means_of(pixels, shape_.n_pixels()));
        for (size_t c = 0; c < pixels.size(); ++c)
            for (size_t k = 0; k < pixels[c].size(); ++k) {
                block.sums[c][k] += pixels[c][k];
                block.squares[c][k / shape_.n_pixels()] += static_cast<double>(pixels[c][k]) * pixels[c][k];
            }
    }

    // The error so far, by a few views: so the number of runs does not depend on how views are cut.
    void judge() {
        const std::vector<float>& all = judged_.means.back();
        const size_t n = probes_.size();
        std::vector<float> means;
        for (int c = 0; c < shape_.n_channels; ++c)
            for (size_t k = 0; k < n; ++k)
                means.push_back(all[c * judged_.views.size() + (judged_.views.size() == n ? k : probes_[k])]);
        if (n_runs() == 1) look_at_other_places(means);
        moments_.add(means);
        if (n_runs() < 2) return;
        double total = 0;
        for (int c = 0; c < shape_.n_channels; ++c) {
            const auto begin = moments_.mean().begin() + static_cast<long>(c * n);
            const std::vector<double> scale = error_scale({begin, begin + static_cast<long>(n)}),
                                      se = standard_errors(moments_, c * n, view_groups(static_cast<int>(n)));
            for (size_t k = 0; k < n; ++k)
                if (scale[k] > 0) total += std::pow(se[k] / scale[k], 2);
        }
        error_ = std::sqrt(total / static_cast<double>(n * shape_.n_channels));
    }

    // The few views once more with more rays through the pixels, under the same light: see PixelMeans.
    // means: theirs, [channel][probe].
    void look_at_other_places(const std::vector<float>& means) {
        BtfShape more = shape_;
        more.pixel_samples *= more_places;
        const std::vector<float> there =
            means_of(values(more, probes_, view_maps(more, probes_, {0.81, 0.67})), more.n_pixels());
        for (int c = 0; c < shape_.n_channels; ++c) {
            double squares = 0;
            for (size_t k = 0; k < probes_.size(); ++k)
                if (const float here = means[c * probes_.size() + k]; here > 0)
                    squares += std::pow(there[c * probes_.size() + k] / here - 1, 2);
            pixel_places_.push_back(
                std::sqrt(squares / ((1 + 1.0 / more_places) * static_cast<double>(probes_.size()))));
        }
    }

    // means: of every run, [channel][view]; squares of the runs' pixels and of their sums, [channel].
    Btf with_errors(const std::vector<std::vector<float>>& means, const std::vector<double>& squares,
                    const std::vector<double>& sum_squares) const {
        Btf btf;
        btf.shape = shape_;
        Table& mean = btf.mean;
        mean.channels = channels_;
        mean.outgoing = view_angles(surface_, plan_);
        Moments moments;
        for (const std::vector<float>& run : means) moments.add(run);
        mean.f.assign(moments.mean().begin(), moments.mean().end());
        std::vector<Vec3> views;
        for (const AnglesDeg& view : mean.outgoing) views.push_back(to_vector(view));
        const std::vector<double> least = sky_->undersampled(views, n_runs());
        const double mesh = predict_mesh_bias(surface_).guess / std::pow(samples_.refinement, 2),
                     runs = n_runs(),
                     pixels = static_cast<double>(shape_.n_views) * static_cast<double>(shape_.n_pixels());
        for (int c = 0; c < shape_.n_channels; ++c) {
            const size_t first = c * size_t(shape_.n_views);
            const double left = std::hypot(mesh, sky_->remainder(), pixel_places_[c]);
            const std::vector<double> se = standard_errors(moments, first, view_groups(shape_.n_views));
            double rare = 0;  // mean square over the views
            for (int v = 0; v < shape_.n_views; ++v) {
                // As in glossy_btf.cpp.
                const double missed = safe_sqrt(std::pow(least[first + v], 2) - 2 * se[v] * se[v]);
                mean.se.push_back(static_cast<float>(se[v]));
                mean.bias.push_back(static_cast<float>(std::hypot(mean.f[first + v] * left, missed)));
                rare += missed * missed / shape_.n_views;
            }
            btf.pixel_se.push_back(std::sqrt(
                std::max(0.0, squares[c] - sum_squares[c] / runs) / (runs - 1) / runs / pixels + rare));
        }
        return btf;
    }

    void describe() {
        report_ = {};
        report_.relative_error = error_;
        report_.target_met =
            plan_.accuracy.samples || error_ <= plan_.accuracy.target() || plan_.accuracy.target() == 0;
        sky_->describe(n_runs(), report_);
        report_.counters.push_back({"view_rays_unresolved", unresolved_});
        report_.counters.push_back({"view_blocks", cut_.blocks});
        report_.seconds = {{"wall", limit_.seconds()}};
    }

    const HeightField& surface_;
    const BtfPlan& plan_;
    const RunOptions& options_;
    const Monitor& monitor_;
    const std::vector<std::string>& channels_;
    Accuracy::Samples samples_;
    BtfShape shape_;
    Cut cut_;
    double judging_share_;  // of the time
    RunLimit limit_;
    std::vector<int> probes_;  // views that are judged by
    std::unique_ptr<GlossySky> sky_;
    std::vector<Vec3> cameras_;
    double plane_height_ = view_plane_height(surface_, plan_);
    Block judged_;                      // all views, or the probes
    Moments moments_;                   // of the probes, [channel][probe]
    std::vector<double> pixel_places_;  // what they do to means, relative, [channel]
    Report report_;
    double error_ = 0, unresolved_ = 0;
};

}  // namespace

Prediction predict_sky_pictures(const HeightField& surface, const Material& material, const BtfPlan& plan) {
    const Accuracy::Samples samples = samples_of(plan);
    const BtfShape shape = btf_shape(surface, material, plan, samples.refinement);
    const Cut cut =
        cut_views(surface, shape, samples, plan.azimuths, static_cast<double>(RunOptions{}.max_bytes));
    Prediction prediction;
    prediction.cpu_seconds = 0.05 + samples.replicates * (cut.judging + cut.pictures);
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds);
    prediction.memory_bytes = (64 << 20) + cut.bytes;
    prediction.table_bytes = 2.0 * static_cast<double>(shape.images_size());
    return prediction;
}

std::unique_ptr<GlossyPictures> glossy_sky_pictures(const HeightField& surface, const Material& material,
                                                    const BtfPlan& plan, const Environment& environment,
                                                    const RunOptions& options, const Monitor& monitor) {
    return std::make_unique<SkyPictures>(surface, material, plan, environment, options, monitor);
}

}  // namespace gonio
