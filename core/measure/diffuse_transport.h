// The diffuse operator behind the seam: Lambertian facets, all orders, mesh and noise bias found and
// corrected.
#pragma once
#include "measure/mesh_bias.h"
#include "measure/transport.h"

namespace gonio {

class DiffuseTransport : public Transport {
  public:
    // Adds to report.skipped what need not be done.
    DiffuseTransport(const MeasuredScene& scene, const Lambertian& material, Report& report);

    RunSettings first_settings(double target) const override;
    RunSettings settings_of(const Accuracy::Samples& samples) const override;
    double least_bytes(const RunSettings& settings) const override;
    double wanted_bytes(const RunSettings& settings) const override;
    RunValues run(const RunSettings& settings, int stage, int run, int n_threads,
                  const Monitor& monitor) const override;
    std::string settings_key(const RunSettings& settings) const override;
    void fix_orders(const RunValues& first) override;
    void begin_stage(const Stage& stage, int n_runs) override;
    void end_stage(Stage& stage, const std::vector<RunValues>& runs, const SideWork& side) override;
    void find_bias(const std::vector<Stage>& stages, const SideWork& side, Report& report) override;
    Estimate estimate(const std::vector<Stage>& stages) const override;
    NextStep next_step(const Stage& stage, const Estimate& estimate, double target) const override;
    RunForecast forecast(const RunSettings& settings) const override;
    double relative_cost(const RunSettings& settings, const RunSettings& reference) const override;
    void describe(const std::vector<Stage>& stages, const RunValues& totals, Report& report) const override;

  private:
    RunContext context_;
    double skipped_bound_ = 0;  // relative, on indirect light that is not computed
    MeshBias mesh_bias_;
};

}  // namespace gonio
