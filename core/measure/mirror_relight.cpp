#include <algorithm>

#include "base/parallel.h"
#include "measure/relit_runs.h"
#include "measure/run.h"
#include "measure/sky_light.h"
#include "scattering/backward.h"
#include "visibility/march.h"

namespace gonio {
namespace {

constexpr int places_together = 1 << 14;  // followed together: their arrays stay in the second-level cache

class MirrorRelitRuns final : public RelitRuns {
  public:
    MirrorRelitRuns(const HeightField& surface, const Material& material, const Environment& environment,
                    const RelightPlan& plan, const Accuracy::Samples& samples, const RunOptions& options,
                    const Monitor& monitor)
        : surface_(surface),
          plan_(plan),
          samples_(samples),
          options_(options),
          monitor_(monitor),
          n_channels_(static_cast<int>(material.channels.size())),
          sky_(sky_on_flat_base(surface, n_channels_, environment)),
          grid_(make_march_grid(surface)),
          tracer_(surface, material, sky_, plan.max_order) {
        const CellRect all{0, 0, surface.nx, surface.ny};
        tile_ = make_tile(surface, all, all, samples.refinement);
        for (const AnglesDeg& view : plan.outgoing) views_.push_back(to_vector(view));
    }

    const MarchGrid& grid() const override { return grid_; }
    const Tile& tile() const override { return tile_; }
    int layers() const override { return static_cast<int>(views_.size()); }
    double remainder() const override { return tally_.seen > 0 ? tally_.left / tally_.seen : 0.0; }
    // Every place is followed for itself, and nothing is constant over a facet part.
    bool evens_out_parts() const override { return false; }
    std::vector<double> doubts() const override {
        return std::vector<double>(n_channels_ * views_.size(), 0.0);
    }

    RelitRun run(int run) override {
        const RunShifts shifts(plan_.accuracy.seed, 0, run);
        const EnvironmentSamples lights =
            sample_environment(sky_, plan_.azimuths * plan_.azimuths, shifts(40), shifts(41));
        const std::vector<SubSample> places = shifted_sub_samples(samples_.sub_samples, shifts(2), shifts(3));
        const size_t n_views = views_.size(), n = tile_.n_unknowns();
        const double share = 1.0 / static_cast<double>(places.size());
        RelitRun result;
        result.radiance.assign(n_channels_, std::vector<float>(n_views * n, 0.0f));
        std::vector<double> sent(n_channels_ * n_views, 0.0);
        VisibleCosines seen;
        for (size_t s = 0; s < places.size(); ++s) {
            const VisibilityBits bits = find_visibility(grid_, tile_, views_, {places[s]},
                                                        options_.allow_skips, options_.n_threads, monitor_);
            rays_ += bits.rays;
            truncated_ += bits.truncated_bundles;
            VisibleCosines here;
            add_cosines(tile_, views_, bits, 1.0, options_.n_threads, here);
            add_cosines(tile_, views_, bits, share, options_.n_threads, seen);
            // The low half of the counters is the tracer's.
            const std::vector<std::vector<float>> radiance =
                trace(places[s], lights, static_cast<uint64_t>(run) * places.size() + s);
            add_sent(tile_, radiance, here, share, options_.n_threads, sent);
            for (int c = 0; c < n_channels_; ++c)
                for (size_t k = 0; k < radiance[c].size(); ++k)
                    result.radiance[c][k] += static_cast<float>(share) * radiance[c][k];
        }
        const std::vector<double> projected = projected_areas(tile_, seen, static_cast<int>(n_views));
        for (size_t k = 0; k < sent.size(); ++k) {
            const double area = projected[k % n_views];
            result.means.push_back(area > 0 ? static_cast<float>(sent[k] / area) : 0.0f);
        }
        return result;
    }

    void describe(int runs, Report& report) const override {
        report.settings = {{"transport", "backward tracing"},
                           {"runs", std::to_string(runs)},
                           {"sub_samples", std::to_string(samples_.sub_samples)},
                           {"refinement", std::to_string(samples_.refinement)}};
        if (tracer_.has_density())
            report.settings.push_back({"sky_directions", std::to_string(plan_.azimuths * plan_.azimuths)});
        report.settings.push_back({"simd", simd_target()});
        report.counters = {{"rays", rays_ + tally_.rays},
                           {"rays_lost", tally_.rays_lost},
                           {"truncated_bundles", truncated_}};
    }

  private:
    // At one place of every part, [channel][view * n_unknowns + unknown].
    std::vector<std::vector<float>> trace(const SubSample& place, const EnvironmentSamples& lights,
                                          uint64_t stream) {
        const int rows = std::clamp(places_together / surface_.nx, 1, surface_.ny),
                  stretches = (surface_.ny + rows - 1) / rows, kinds = 2 * tile_.n_parts(),
                  n_tasks = static_cast<int>(views_.size()) * kinds * stretches;
        std::vector<std::vector<float>> radiance(
            n_channels_, std::vector<float>(views_.size() * tile_.n_unknowns(), 0.0f));
        std::vector<BackwardTally> tallies(n_tasks);
        parallel_for(n_tasks, options_.n_threads, [&](int task) {
            monitor_.check_cancelled();
            const int kind = task / stretches % 2, part = task / stretches / 2 % tile_.n_parts(),
                      view = task / stretches / kinds, first = task % stretches * rows;
            SeenPlaces seen{facet_point(kind, place.a, place.b, tile_.refinement, part), first,
                            std::min(rows, surface_.ny - first), views_[view]};
            const size_t nx = surface_.nx;
            std::vector<float> found(n_channels_ * seen.n_rows * nx);
            tallies[task] = tracer_.trace(seen, lights, plan_.accuracy.seed, backward_stream + stream,
                                          static_cast<uint64_t>(task) << 32, found);
            for (int c = 0; c < n_channels_; ++c)
                for (int row = 0; row < seen.n_rows; ++row)
                    std::copy_n(&found[(static_cast<size_t>(c) * seen.n_rows + row) * nx], nx,
                                &radiance[c][view * tile_.n_unknowns() + part * tile_.n_slots() +
                                             tile_.slot(kind, first + row, 0)]);
        });
        for (const BackwardTally& tally : tallies) {
            tally_.rays += tally.rays;
            tally_.rays_lost += tally.rays_lost;
            tally_.left += tally.left;
            tally_.seen += tally.seen;
        }
        return radiance;
    }

    static constexpr uint64_t backward_stream = uint64_t{1} << 48;  // apart from those of RunShifts

    const HeightField& surface_;
    const RelightPlan& plan_;
    Accuracy::Samples samples_;
    const RunOptions& options_;
    const Monitor& monitor_;
    int n_channels_;
    Environment sky_;
    MarchGrid grid_;
    Tile tile_;
    BackwardTracer tracer_;
    std::vector<Vec3> views_;
    BackwardTally tally_;
    double rays_ = 0, truncated_ = 0;
};

}  // namespace

std::unique_ptr<RelitRuns> mirror_relit_runs(const HeightField& surface, const Material& material,
                                             const Environment& environment, const RelightPlan& plan,
                                             const Accuracy::Samples& samples, const RunOptions& options,
                                             const Monitor& monitor) {
    return std::make_unique<MirrorRelitRuns>(surface, material, environment, plan, samples, options, monitor);
}

}  // namespace gonio
