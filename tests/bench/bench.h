// What the benchmarks share: CPU time, the fields and direction sets of the published figures.
#pragma once
#include <time.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "directions/gonio_grid.h"
#include "measure/brdf.h"
#include "surface/generate.h"

namespace gonio::bench {

// CPU seconds of this process: other work on the machine does not count, unlike in wall time.
inline double cpu_seconds() {
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
inline double wall_seconds() {
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Gaussian field, 1 um pitch, correlation length in cells, rms |grad h| = slope.
inline HeightField field(int n, double slope, double correlation_cells = 8) {
    return generate_gaussian(n, n, 1e-6, correlation_cells * 1e-6, slope, 1);
}

// 64 directions off every symmetry: theta 10..80 deg, 8 azimuths turned a little with theta.
inline std::vector<AnglesDeg> sixty_four_directions() {
    std::vector<AnglesDeg> list;
    for (int a = 0; a < 8; ++a)
        for (int t = 0; t < 8; ++t) list.push_back({10.0 + 10 * t, (a + 0.137 + 0.031 * t) * 45});
    return list;
}

inline Material lambertian(double albedo) {
    return {{"y"}, Lambertian{albedo}};
}

}  // namespace gonio::bench
