// Forward tracing behind the seam: any material, into receiver cells. A run follows the light of each
// incident direction from its own random places inside the facets.
#pragma once
#include <optional>

#include "measure/transport.h"
#include "scattering/forward.h"

namespace gonio {

class ForwardTransport : public Transport {
  public:
    // The plan must have outgoing cells.
    explicit ForwardTransport(const MeasuredScene& scene);

    RunSettings first_settings(double target) const override;
    RunSettings settings_of(const Accuracy::Samples& samples) const override;
    double least_bytes(const RunSettings& settings) const override;
    double wanted_bytes(const RunSettings& settings) const override;
    RunValues run(const RunSettings& settings, int stage, int run, int n_threads,
                  const Monitor& monitor) const override;
    std::string settings_key(const RunSettings& settings) const override;
    void fix_orders(const RunValues& first) override;
    // Throws Error(limit) for more than 2^28 surface cells.
    void begin_stage(const Stage& stage, int n_runs) override;
    Estimate estimate(const std::vector<Stage>& stages) const override;
    NextStep next_step(const Stage& stage, const Estimate& estimate, double target) const override;
    RunForecast forecast(const RunSettings& settings) const override;
    double relative_cost(const RunSettings& settings, const RunSettings& reference) const override;
    void describe(const std::vector<Stage>& stages, const RunValues& totals, Report& report) const override;

  private:
    MeasuredScene scene_;
    std::optional<ForwardScene> forward_;  // from the first stage on
    std::vector<double> projected_sr_;     // of each cell
    int single_orders_ = 0;  // slices of single orders to keep; 0: as many as the first run meets
};

}  // namespace gonio
