// What a user should see before running: is this the surface that was meant?
#pragma once
#include <string>
#include <vector>

#include "surface/height_field.h"

namespace gonio {

struct SurfaceStatistics {
    int nx = 0, ny = 0;
    double pitch_x = 0, pitch_y = 0;              // metres
    double width = 0, depth = 0;                  // metres
    double sq = 0;                                // rms height about the mean, metres
    double height_min = 0, height_max = 0;        // metres, absolute
    double rms_slope_x = 0, rms_slope_y = 0;      // over facets, weighted by base area; an open surface's seam is left out
    double max_slope = 0;                         // steepest facet, |grad h|
    double wrap_jump_x = 0, wrap_jump_y = 0;      // rms step across the seam / rms step inside; 1 is seamless
    // Lag where the autocorrelation falls to 1/e, metres; 0 if it does not within half the period.
    double correlation_length_x = 0, correlation_length_y = 0;
    int distinct_heights = 0;                     // number of distinct stored heights, counted to 70,000
    bool invariant_x = false, invariant_y = false;  // all columns (rows) alike
};

SurfaceStatistics surface_statistics(const HeightField& surface);

// Sentences a user should read: 8-bit terraces, a bad seam of a surface taken as periodic, pitch near the wavelength of light.
std::vector<std::string> surface_warnings(const HeightField& surface, const SurfaceStatistics& statistics);

}  // namespace gonio
