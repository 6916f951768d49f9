// Spatial maps of a relief, for looking: light, shadow and sky, one pixel a cell, seen from straight above.
#pragma once
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/plan.h"
#include "measure/prediction.h"
#include "measure/report.h"

namespace gonio {

struct MapsPlan {
    std::vector<AnglesDeg> incident, outgoing;  // lights and views; either may be empty
    int sky_directions = 256;                   // over the upper hemisphere; 0: no sky map
    int max_order = 0;                          // as in BrdfPlan
    Accuracy accuracy;  // target: rms standard error of a pixel of the light maps over their mean
};

// The mean of a cell's two facets, by projected area.
struct MapLayer {
    std::string name;           // "light000.direct.Y", "light000.shadow", "view000.mask", "sky"
    std::vector<float> pixels;  // [row][column], row 0 at low y
    double mean = 0, se = 0;    // over all pixels; standard error of a pixel, rms
};

// For every light and channel C: direct, indirect, total (exitance over the irradiance of the flat base
// plane, so that a white plane is 1); for every light shadow and for every view mask (share of the cell that
// the light reaches, or that the viewer sees; facets that face away count as shadowed and masked); sky:
// cosine-weighted share of the upper hemisphere that a facet sees (1 on a plane).
//
// What leaves a glossy facet depends on the view: there direct, indirect and total are irradiances, of what
// arrives, over the same unit.
struct Maps {
    int nx = 0, ny = 0;
    std::vector<MapLayer> layers;
};

struct MapsResult {
    Maps maps;
    Report report;
};

// Throws Error: for mirrors; limit; cancelled.
MapsResult measure_maps(const HeightField& surface, const Material& material, const MapsPlan& plan,
                        const RunOptions& options, const Monitor& monitor = {});
Prediction predict_maps(const HeightField& surface, const Material& material, const MapsPlan& plan);

}  // namespace gonio
