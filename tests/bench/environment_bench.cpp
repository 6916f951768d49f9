// Irradiance of every facet from an environment by horizon slices: CPU time of one thread, and the error
// against 256 azimuths of exact horizons, rms over the mean. The light is of order 4 (spherical harmonics to
// degree 3), as in shared/performance_techniques 2.
#include <cstdio>

#include "base/random.h"
#include "scattering/environment_slices.h"
#include "tests/bench/bench.h"

using namespace gonio;

namespace {

Environment order_4_light() {
    Environment e;
    e.nx = 256, e.ny = 128, e.n_channels = 1;
    for (int j = 0; j < e.ny; ++j)
        for (int i = 0; i < e.nx; ++i) {
            const double theta = pi * (j + 0.5) / e.ny, phi = pi * (1 - 2 * (i + 0.5) / e.nx);
            const double x = std::sin(theta) * std::cos(phi), y = std::sin(theta) * std::sin(phi),
                         z = std::cos(theta);
            const double terms[] = {x,
                                    y,
                                    z,
                                    x * y,
                                    y * z,
                                    x * z,
                                    x * x - y * y,
                                    x * (x * x - 3 * y * y),
                                    z * (x * x - y * y),
                                    y * (5 * z * z - 1)};
            double light = 2;
            for (size_t k = 0; k < std::size(terms); ++k)
                light += (uniform_double(random_words(7, k, 0)[0]) - 0.5) * terms[k];
            e.radiance.push_back(static_cast<float>(light));
        }
    return e;
}

void measure(int n, double slope, double correlation_cells) {
    const HeightField surface = bench::field(n, slope, correlation_cells);
    const MarchGrid grid = make_march_grid(surface);
    const CellRect all{0, 0, n, n};
    const Tile tile = make_tile(surface, all, all, 1);
    const Environment sky = order_4_light();
    const SubSample place{0.65, 0.33};
    const Monitor monitor;
    const Fields exact = sky_irradiance(
        grid, tile, sky, place, {.azimuths = 256, .shift = 0.5, .horizon = {.exact = true}}, 1, monitor);
    for (const int azimuths : {8, 16, 32}) {
        std::vector<double> seconds;
        double squares = 0, sum = 0, difference = 0;
        for (int repeat = 0; repeat < 3; ++repeat) {
            const double start = bench::cpu_seconds();
            const Fields e = sky_irradiance(grid, tile, sky, place,
                                            {.azimuths = azimuths, .shift = 0.5, .horizon = {}}, 1, monitor);
            seconds.push_back(bench::cpu_seconds() - start);
            squares = sum = difference = 0;
            for (size_t u = 0; u < tile.n_unknowns(); ++u) {
                if (tile.sqrt_area[u] == 0) continue;
                const double truth = exact.block(0)[u * column_block] / tile.sqrt_area[u],
                             d = e.block(0)[u * column_block] / tile.sqrt_area[u] - truth;
                squares += d * d, difference += d, sum += truth;
            }
        }
        std::sort(seconds.begin(), seconds.end());
        const double count = 2.0 * n * n;
        std::printf("%d,%.1f,%.0f,%d,%.3f,%.1f,%.3f,%.3f\n", n, slope, correlation_cells, azimuths,
                    seconds[1], 1e9 * seconds[1] / (count * azimuths),
                    100 * std::sqrt(squares / count) * count / sum, 100 * difference / sum);
        std::fflush(stdout);
    }
}

}  // namespace

int main() {
    std::printf("n,slope,correlation_cells,azimuths,cpu_s,ns_per_facet_azimuth,rms_percent,mean_percent\n");
    measure(512, 0.5, 32);
    measure(512, 0.7, 8);
}
