// The light that the facets of a whole relief send back, one random run after the other: what BTFs, light
// fields and maps are made of.
#pragma once
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/plan.h"
#include "measure/report.h"
#include "scattering/radiosity.h"

namespace gonio {

class FacetLight {
  public:
    // Throws Error for a material that is not Lambertian. The references must outlive it.
    FacetLight(const HeightField& surface, const Material& material, int max_order,
               const Accuracy::Samples& samples, uint64_t seed, const RunOptions& options,
               const Monitor& monitor);

    const MarchGrid& grid() const { return grid_; }
    const Tile& tile() const { return tile_; }  // the whole period
    bool has_map() const { return !maps_.empty(); }
    int n_channels() const { return static_cast<int>(albedo_.n_channels()); }
    const Accuracy::Samples& samples() const { return samples_; }

    // Draws the shifts of run 0, 1, ...: places inside the facets, directions of the operator.
    void start_run(int run);
    const std::vector<SubSample>& places() const { return places_; }  // of the run that was started
    // Of the run that was started. The sub-samples of light_irradiance() may be others than samples() says.
    LightIrradiance irradiance(const std::vector<Vec3>& lights);
    Radiosity radiosity(const Fields& irradiance);

    // Unknown of the tile, whose rows are padded, from facet_index() of visibility/view_map.h.
    size_t unknown_of(size_t facet) const { return facet / surface_.nx * tile_.stride + facet % surface_.nx; }
    // Albedo of a channel where that unknown lies.
    double albedo_of(int channel, size_t unknown) const {
        if (!albedo_.is_map()) return albedo_.constant[channel];
        const size_t slot = unknown % tile_.n_slots(), row = slot / tile_.stride % surface_.ny;
        return albedo_.at(channel, static_cast<int>(slot % tile_.stride), static_cast<int>(row));
    }
    float sqrt_area(size_t unknown) const { return tile_.sqrt_area[unknown % tile_.n_slots()]; }

    double remainder() const { return remainder_; }  // of the orders, see Radiosity: the largest
    // Settings and counters of the runs so far.
    void describe(int runs, Report& report) const;

  private:
    const HeightField& surface_;
    Parameter albedo_;
    int max_order_;
    Accuracy::Samples samples_;
    uint64_t seed_;
    const RunOptions& options_;
    const Monitor& monitor_;
    MarchGrid grid_;
    Tile tile_;
    std::vector<ChannelFactors> maps_;
    LinkOperator op_;
    std::vector<SubSample> places_;
    bool indirect_ = false;
    double rays_ = 0, links_ = 0, truncated_ = 0, remainder_ = 0;
    int applications_ = 0;
};

}  // namespace gonio
