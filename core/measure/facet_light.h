// The light that the facets of a whole relief send back, one random run after the other: what BTFs, light
// fields and maps are made of.
#pragma once
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/plan.h"
#include "measure/report.h"
#include "scattering/radiosity.h"
#include "scattering/turned_radiosity.h"

namespace gonio {

class FacetLight {
  public:
    // Throws Error for a material that is not Lambertian. The references must outlive it.
    FacetLight(const HeightField& surface, const Material& material, int max_order,
               const Accuracy::Samples& samples, uint64_t seed, const RunOptions& options,
               const Monitor& monitor);

    const MarchGrid& grid() const { return grid_; }
    const Tile& tile() const { return tile_; }  // the whole period
    // The same with areas of 1: irradiance factors of it are per area, as all light is here.
    const Tile& unit_tile() const { return unit_tile_; }
    int n_channels() const { return static_cast<int>(radiosity_.albedo().n_channels()); }
    const Accuracy::Samples& samples() const { return samples_; }

    // Draws the shifts of run 0, 1, ...: places inside the facets, directions of the operator.
    void start_run(int run);
    const std::vector<SubSample>& places() const { return places_; }  // of the run that was started
    // Of the run that was started: irradiance of the facet parts, in units of what a facet that faces the
    // light receives.
    LightIrradiance irradiance(const std::vector<Vec3>& lights);
    // albedo E of each channel, E of all orders; kept until the next call. Of any irradiance on a flat base;
    // of lights, whose irradiance() that is, on every base: on a curved one each facet is told in its own
    // frame.
    const std::vector<Fields>& radiosity(const Fields& irradiance) { return radiosity_.of(irradiance); }
    const std::vector<Fields>& radiosity(const std::vector<Vec3>& lights, const Fields& irradiance);

    // Unknown of the tile, whose rows are padded, from facet_index() of visibility/view_map.h.
    size_t unknown_of(size_t facet) const { return facet / surface_.nx * tile_.stride + facet % surface_.nx; }
    // Albedo of a channel where that unknown lies.
    double albedo_of(int channel, size_t unknown) const {
        return radiosity_.albedo().at(channel, unknown % tile_.n_slots());
    }
    float area(size_t unknown) const {
        const float root = tile_.sqrt_area[unknown % tile_.n_slots()];
        return root * root;
    }

    // Of the orders: the largest.
    double remainder() const { return std::max(radiosity_.remainder(), turned_.remainder); }
    // Settings and counters of the runs so far.
    void describe(int runs, Report& report) const;

  private:
    const HeightField& surface_;
    Accuracy::Samples samples_;
    uint64_t seed_;
    const RunOptions& options_;
    const Monitor& monitor_;
    MarchGrid grid_;
    Tile tile_, unit_tile_;
    Radiosity radiosity_;
    // On a curved base, where light turns from facet to facet, in its place.
    std::array<LinkOperator, 2> turning_;
    TurnedRadiosity turned_;
    std::vector<SubSample> places_;
    bool indirect_ = false, twice_ = false;  // orders beyond the first, and beyond the second, are wanted
    double rays_ = 0, links_ = 0, truncated_ = 0;
};

}  // namespace gonio
