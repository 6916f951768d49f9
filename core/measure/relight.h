// A relief under an environment: what a camera sees of it, and how much it sends back on the whole (Heidrich
// et al. 2000, fig. 10). Radiances are in the unit of the environment's; a white relief under a uniform sky
// of 1 has radiance 1 everywhere.
#pragma once
#include <vector>

#include "base/monitor.h"
#include "measure/plan.h"
#include "measure/prediction.h"
#include "measure/report.h"
#include "scattering/environment.h"

namespace gonio {

struct RelightPlan {
    std::vector<AnglesDeg> outgoing;
    // >= 3: of the horizon slices of Lambertian facets; glossy ones look at azimuths^2 directions a run, and
    // what mirrors are mixed with draws from these.
    int azimuths = 16;
    int pixels_x = 0, pixels_y = 0;  // over the measured rectangle; 0: one a cell
    // Where a view ray belongs to a pixel: at the highest point of the relief, or at height 0 as it was
    // given.
    enum class Plane { top, zero } plane = Plane::top;
    int max_order = 0;  // as in BrdfPlan
    Accuracy accuracy;  // target: of the directional means
};

struct Relit {
    int n_channels = 0, n_views = 0, pixels_x = 0, pixels_y = 0;
    // Exit radiance of every facet part, [channel][facet_index() of visibility/view_map.h]; of glossy ones
    // towards every view, [channel][view][facet], 0 where it faces away.
    size_t n_facets = 0;
    std::vector<float> radiance;
    std::vector<double>
        radiance_se;  // [channel]: standard error of one facet's, rms over the relief's area (and the views)
    std::vector<float> images;  // [view][channel][row][column], row 0 at low y
    // Radiance averaged over the surface as each view sees it, [channel][view]; standard error of the random
    // runs; bias: orders left out, and irradiance that is constant over a facet part.
    std::vector<double> mean, se, bias;
};

struct RelightResult {
    Relit relit;
    Report report;
};

// Throws Error: for curved bases; for RGB light on a spectrum; limit; cancelled.
RelightResult measure_relight(const HeightField& surface, const Material& material,
                              const Environment& environment, const RelightPlan& plan,
                              const RunOptions& options, const Monitor& monitor = {});
Prediction predict_relight(const HeightField& surface, const Material& material, const RelightPlan& plan);

}  // namespace gonio
