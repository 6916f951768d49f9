// What one run of a transport will take and leave, foreseen from the scene and the settings alone: the same
// on any machine, so that what is decided by it is.
//
// Power laws through runs of 6 on Gaussian reliefs (64^2 and 128^2 cells, rms slope 0.25 to 1, correlation
// length 3 and 8 cells), 16 lights, 16 and 64 directions, 16, 64 and 145 cells; Lambertian, GGX 0.01 to 0.5,
// Beckmann, Phong, Blinn-Phong, coats, mixtures, mirrors. Most errors of these runs are met within 1.6;
// forward tracing of lobes below 0.1 within 5 (its dark cells have heavy tails). Times are those of one core
// of a busy machine.
#pragma once
#include "measure/scene.h"

namespace gonio {

struct RunSettings;

struct RunForecast {
    double cpu_seconds = 0;  // of one thread
    // Relative to the table as Estimate::total: standard error of one run, of order 1 and of the orders
    // beyond; and what no further run takes away.
    double direct = 0, indirect = 0, lasting = 0;
    double untold = 0;  // error that stated errors do not hold, for no sample meets what makes it
};

RunForecast forecast_diffuse(const MeasuredScene& scene, const RunSettings& settings);
RunForecast forecast_graph(const MeasuredScene& scene, const RunSettings& settings);
RunForecast forecast_forward(const MeasuredScene& scene, const RunSettings& settings);

}  // namespace gonio
