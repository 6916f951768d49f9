// Horizons: for each azimuth, how high the relief stands above every receiver, and how far away the point
// that hides the sky is (Max 1988; the distance is what Onoue, Max, Nishita 2004 need on a curved base).
#pragma once
#include <vector>

#include "base/monitor.h"
#include "visibility/crossings.h"

namespace gonio {

// Horizon towards one azimuth, [j * nx + i], one receiver a cell.
struct HorizonSlice {
    std::vector<float> slope;     // tan of the elevation, >= 0
    std::vector<float> distance;  // horizontal, metres; 0 where nothing stands above the receiver
};

struct HorizonMap {
    int nx = 0, ny = 0;
    FacetPoint receiver;          // where in its cell every receiver stands
    std::vector<double> azimuth;  // radians from +x towards +y
    std::vector<HorizonSlice> slices;
};

struct HorizonOptions {
    // The march over all edges of the mesh, up to max_horizon_travel: 3 to 5 times slower than the hull sweep
    // (horizon_sweep.h), which never reads higher and is 2e-4 to 1e-3 rad lower (rms over Gaussian fields of
    // slope 0.3 to 0.7, which includes one receiver in a few hundred with another horizon point).
    bool exact = false;
    // The sweep does not look for relief further away than it could rise above this slope: lower horizons may
    // read as 0. At 0.05 that adds less than 2e-4 rad to the rms. > 0.
    double smallest_slope = 0.05;
};

inline constexpr double max_horizon_travel = 16384;  // cells
// Of node (i, j) itself.
inline constexpr FacetPoint node_receiver{0, 0, 0};

// azimuth: radians, any. receiver: node_receiver, or a place inside a facet, whose own plane then bounds its
// sky.
HorizonSlice compute_horizon(const MarchGrid& grid, double azimuth, const FacetPoint& receiver,
                             const HorizonOptions& options);

// One slice an azimuth; the same bits for any n_threads.
HorizonMap make_horizon_map(const MarchGrid& grid, const std::vector<double>& azimuths,
                            const FacetPoint& receiver, const HorizonOptions& options, int n_threads,
                            const Monitor& monitor);

// n azimuths (k + shift) 2 pi / n.
std::vector<double> uniform_azimuths(int n, double shift);

}  // namespace gonio
