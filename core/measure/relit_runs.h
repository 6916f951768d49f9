// Random runs of a relief under an environment, by who carries the light. Internal to measure/.
#pragma once
#include <memory>
#include <vector>

#include "measure/accuracy.h"
#include "measure/relight.h"
#include "scattering/tile.h"
#include "scattering/visibility_bits.h"
#include "visibility/march_grid.h"

namespace gonio {

struct RelitRun {
    // Radiance averaged over the surface as each view sees it, [channel][view].
    std::vector<float> means;
    // Of every facet part of the tile, [channel][layer * n_unknowns + unknown].
    std::vector<std::vector<float>> radiance;
};

class RelitRuns {
  public:
    virtual ~RelitRuns() = default;
    virtual const MarchGrid& grid() const = 0;
    virtual const Tile& tile() const = 0;  // the whole period
    // Of the radiances: one for every view, or one for all, if facets send all views the same.
    virtual int layers() const = 0;
    virtual RelitRun run(int run) = 0;
    // Of the runs so far. Orders left out, relative; what else the random runs do not show, [channel][view].
    virtual double remainder() const = 0;
    virtual std::vector<double> doubts() const = 0;
    // Whether irradiance is taken as constant over a facet part.
    virtual bool evens_out_parts() const { return true; }
    virtual void describe(int runs, Report& report) const = 0;  // settings, counters, warnings
};

// The references must outlive them. Throw Error as measure_relight does.
std::unique_ptr<RelitRuns> lambertian_relit_runs(const HeightField& surface, const Material& material,
                                                 const Environment& environment, const RelightPlan& plan,
                                                 const Accuracy::Samples& samples, const RunOptions& options,
                                                 const Monitor& monitor);
std::unique_ptr<RelitRuns> glossy_relit_runs(const HeightField& surface, const Material& material,
                                             const Environment& environment, const RelightPlan& plan,
                                             const Accuracy::Samples& samples, const RunOptions& options,
                                             const Monitor& monitor);

// Of mirrors, alone or in mixtures.
std::unique_ptr<RelitRuns> mirror_relit_runs(const HeightField& surface, const Material& material,
                                             const Environment& environment, const RelightPlan& plan,
                                             const Accuracy::Samples& samples, const RunOptions& options,
                                             const Monitor& monitor);

// sent[channel * n_views + view] += share * sum of area cosine radiance over the parts that are seen.
// radiances: [channel][view * n_unknowns + unknown]; seen: of the views.
void add_sent(const Tile& tile, const std::vector<std::vector<float>>& radiances, const VisibleCosines& seen,
              double share, int n_threads, std::vector<double>& sent);

// Groups of the means of one channel, a group of its own each view.
RowGroups view_groups(int n_views);

}  // namespace gonio
