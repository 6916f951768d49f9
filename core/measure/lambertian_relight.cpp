#include "base/parallel.h"
#include "measure/relit_runs.h"
#include "measure/sky_light.h"

namespace gonio {
namespace {

class LambertianRelitRuns final : public RelitRuns {
  public:
    LambertianRelitRuns(const HeightField& surface, const Material& material, const Environment& environment,
                        const RelightPlan& plan, const Accuracy::Samples& samples, const RunOptions& options,
                        const Monitor& monitor)
        : options_(options),
          monitor_(monitor),
          n_channels_(static_cast<int>(material.channels.size())),
          light_(surface, material, plan.max_order, samples, plan.accuracy.seed, options, monitor),
          sky_(surface, environment, n_channels_, plan.azimuths, plan.accuracy.seed, options, monitor) {
        for (const AnglesDeg& view : plan.outgoing) views_.push_back(to_vector(view));
    }

    const MarchGrid& grid() const override { return light_.grid(); }
    const Tile& tile() const override { return light_.tile(); }
    int layers() const override { return 1; }
    double remainder() const override { return light_.remainder(); }
    std::vector<double> doubts() const override {
        return std::vector<double>(n_channels_ * views_.size(), 0.0);
    }

    // The first order is formed place by place, for inside a facet what is lit and what is seen are
    // correlated; the others leave it evenly.
    RelitRun run(int run) override {
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
            const Fields direct = sky_.irradiance(light_, run, place);
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
        RelitRun result;
        for (int c = 0; c < n_channels_; ++c) {
            for (size_t v = 0; v < n_views; ++v)
                result.means.push_back(projected[v] > 0
                                           ? static_cast<float>(sent[c * n_views + v] / (pi * projected[v]))
                                           : 0.0f);
            std::vector<float>& radiance = result.radiance.emplace_back(tile.n_unknowns());
            for (size_t u = 0; u < tile.n_unknowns(); ++u)
                radiance[u] = static_cast<float>(value(radiosity[c], u, c) / pi);
        }
        return result;
    }

    void describe(int runs, Report& report) const override {
        light_.describe(runs, report);
        report.settings.emplace_back("key_lights", std::to_string(sky_.n_key_lights()));
    }

  private:
    const RunOptions& options_;
    const Monitor& monitor_;
    int n_channels_;
    FacetLight light_;
    SkyLight sky_;
    std::vector<Vec3> views_;
};

}  // namespace

std::unique_ptr<RelitRuns> lambertian_relit_runs(const HeightField& surface, const Material& material,
                                                 const Environment& environment, const RelightPlan& plan,
                                                 const Accuracy::Samples& samples, const RunOptions& options,
                                                 const Monitor& monitor) {
    return std::make_unique<LambertianRelitRuns>(surface, material, environment, plan, samples, options,
                                                 monitor);
}

}  // namespace gonio
