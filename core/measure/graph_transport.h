// The pair graph behind the seam: every material with a density, mixtures included.
#pragma once
#include "measure/graph_run.h"
#include "measure/narrow_lobes.h"
#include "measure/transport.h"

namespace gonio {

class GraphTransport : public Transport {
  public:
    // Adds to report.skipped what need not be done.
    GraphTransport(const MeasuredScene& scene, Report& report);

    RunSettings first_settings(double target) const override;
    RunSettings settings_of(const Accuracy::Samples& samples) const override;
    double least_bytes(const RunSettings& settings) const override;
    double wanted_bytes(const RunSettings& settings) const override;
    RunValues run(const RunSettings& settings, int stage, int run, int n_threads,
                  const Monitor& monitor) const override;
    std::string settings_key(const RunSettings& settings) const override;
    void fix_orders(const RunValues& first) override;
    void find_bias(const std::vector<Stage>& stages, const SideWork& side, Report& report) override;
    Estimate estimate(const std::vector<Stage>& stages) const override;
    NextStep next_step(const Stage& stage, const Estimate& estimate, double target) const override;
    RunForecast forecast(const RunSettings& settings) const override;
    double relative_cost(const RunSettings& settings, const RunSettings& reference) const override;
    void describe(const std::vector<Stage>& stages, const RunValues& totals, Report& report) const override;

  private:
    bool fits(const RunSettings& settings) const;
    // What a stage has met narrow lobes with.
    struct Sampling {
        NarrowLobes lobes;
        int first_sampled = 0;                   // first_sampled_order
        double pairs = 0, facets = 0, rays = 0;  // of all runs, and rays of a light; facets that pairs leave
    };
    Sampling sampling(const Stage& stage) const;
    // Chains of samples that meet a view, [order - 2], see narrow_lobes.h.
    static std::vector<double> chains(const Sampling& sampling, const std::vector<double>& later);
    // Adds what they leave undersampled to the biases. indirect: the part beyond the first order, as e.f.
    void add_rare(const Stage& stage, const std::vector<double>& indirect, Estimate& e) const;
    double most_chains(const Sampling& sampling) const;  // of order 2, over lights and channels

    GraphContext context_;
    double skipped_bound_ = 0;  // relative, on indirect light that is not computed
    double mesh_doubt_ = 0;     // relative to the indirect part: radiance is constant over a facet part
    bool mesh_measured_ = false;
    LaterLight later_;  // if lobes are narrow
};

}  // namespace gonio
