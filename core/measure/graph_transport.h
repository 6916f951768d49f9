// The pair graph behind the seam: every material with a density, mixtures included.
#pragma once
#include "measure/graph_run.h"
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

    GraphContext context_;
    double skipped_bound_ = 0;  // relative, on indirect light that is not computed
    double mesh_doubt_ = 0;     // relative to the indirect part: radiance is constant over a facet part
    bool mesh_measured_ = false;
};

}  // namespace gonio
