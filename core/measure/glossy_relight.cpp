#include <cmath>

#include "base/numeric.h"
#include "measure/accuracy.h"
#include "measure/glossy_sky.h"
#include "measure/relit_runs.h"

namespace gonio {
namespace {

class GlossyRelitRuns final : public RelitRuns {
  public:
    GlossyRelitRuns(const HeightField& surface, const Material& material, const Environment& environment,
                    const RelightPlan& plan, const Accuracy::Samples& samples, const RunOptions& options,
                    const Monitor& monitor)
        : options_(options),
          monitor_(monitor),
          sky_(surface, material, environment, plan.azimuths, plan.max_order, samples, plan.accuracy.seed,
               options, monitor) {
        for (const AnglesDeg& view : plan.outgoing) views_.push_back(to_vector(view));
    }

    const MarchGrid& grid() const override { return sky_.grid(); }
    const Tile& tile() const override { return sky_.tile(); }
    int layers() const override { return static_cast<int>(views_.size()); }
    double remainder() const override { return sky_.remainder(); }

    // From order 3 on the shared directions are used more than once (see shared_directions_doubt); and of
    // narrow lobes what the scatter does not tell (see GraphTransport::add_rare).
    std::vector<double> doubts() const override {
        std::vector<double> doubts;
        const size_t n_views = views_.size();
        const std::vector<double> least = sky_.undersampled(views_, indirect_.count());
        for (size_t c = 0; c < sky_.n_channels(); ++c) {
            const std::vector<double> se = standard_errors(means_, c * n_views, view_groups(layers())),
                                      se_indirect =
                                          standard_errors(indirect_, c * n_views, view_groups(layers()));
            for (size_t v = 0; v < n_views; ++v) {
                const double rare = least[c * n_views + v];
                doubts.push_back(
                    std::hypot(shared_directions_doubt * std::sqrt(indirect_.count()) * se_indirect[v],
                               safe_sqrt(rare * rare - 2 * se[v] * se[v])));
            }
        }
        return doubts;
    }

    // Place by place, for inside a facet what is lit and what is seen are correlated; the orders beyond the
    // first leave it evenly.
    RelitRun run(int run) override {
        sky_.start_run(run);
        const size_t n = sky_.tile().n_unknowns(), n_views = views_.size();
        const Receivers every_part{n * n_views, [&](size_t first, size_t count, SeenParts& out) {
                                       for (size_t k = 0; k < count; ++k)
                                           out.set(k, (first + k) % n, views_[(first + k) / n]);
                                   }};
        RelitRun result;
        result.radiance.assign(sky_.n_channels(), std::vector<float>(every_part.count, 0.0f));
        VisibleCosines seen;
        std::vector<double> sent(sky_.n_channels() * n_views, 0.0);
        const double share = 1.0 / static_cast<double>(sky_.places().size());
        for (const SubSample& place : sky_.places()) {
            const VisibilityBits bits = find_visibility(sky_.grid(), sky_.tile(), views_, {place},
                                                        options_.allow_skips, options_.n_threads, monitor_);
            VisibleCosines here;
            add_cosines(sky_.tile(), views_, bits, 1.0, options_.n_threads, here);
            add_cosines(sky_.tile(), views_, bits, share, options_.n_threads, seen);
            const Radiances direct = sky_.direct(place, every_part);
            add_sent(tile(), direct, here, share, options_.n_threads, sent);
            for (size_t c = 0; c < direct.size(); ++c)
                for (size_t k = 0; k < direct[c].size(); ++k)
                    result.radiance[c][k] += static_cast<float>(share) * direct[c][k];
        }
        const Radiances indirect = sky_.indirect(every_part);
        std::vector<double> sent_indirectly(sent.size(), 0.0);
        add_sent(tile(), indirect, seen, 1.0, options_.n_threads, sent_indirectly);
        for (size_t c = 0; c < indirect.size(); ++c)
            for (size_t k = 0; k < indirect[c].size(); ++k) result.radiance[c][k] += indirect[c][k];
        const std::vector<double> projected = projected_areas(sky_.tile(), seen, static_cast<int>(n_views));
        std::vector<float> means_indirect;
        for (size_t k = 0; k < sent.size(); ++k) {
            const double area = projected[k % n_views];
            result.means.push_back(area > 0 ? static_cast<float>((sent[k] + sent_indirectly[k]) / area)
                                            : 0.0f);
            means_indirect.push_back(area > 0 ? static_cast<float>(sent_indirectly[k] / area) : 0.0f);
        }
        indirect_.add(means_indirect);
        means_.add(result.means);
        return result;
    }

    void describe(int runs, Report& report) const override { sky_.describe(runs, report); }

  private:
    const RunOptions& options_;
    const Monitor& monitor_;
    GlossySky sky_;
    std::vector<Vec3> views_;
    Moments means_;     // [channel][view]
    Moments indirect_;  // what orders 2 and up add to the means, [channel][view]
};

}  // namespace

std::unique_ptr<RelitRuns> glossy_relit_runs(const HeightField& surface, const Material& material,
                                             const Environment& environment, const RelightPlan& plan,
                                             const Accuracy::Samples& samples, const RunOptions& options,
                                             const Monitor& monitor) {
    return std::make_unique<GlossyRelitRuns>(surface, material, environment, plan, samples, options, monitor);
}

}  // namespace gonio
