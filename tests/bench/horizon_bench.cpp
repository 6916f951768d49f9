// Horizon maps: the hull sweep against the march that takes the largest slope, one thread, CPU time
// interleaved. Prints nanoseconds per receiver and azimuth, their ratio, and the sweep's error against the
// march: rms and 99th percentile of the elevation in rad, and the share of receivers whose elevation is off
// by more than 1e-4 rad, most of them by another horizon point.
#include <cstdio>

#include "tests/bench/bench.h"
#include "visibility/horizon_map.h"
#include "visibility/march.h"

using namespace gonio;

namespace {

struct Field {
    int n;
    double slope, correlation_cells;
};

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

template <class Work>
double timed(Work&& work) {
    const double start = bench::cpu_seconds();
    work();
    return bench::cpu_seconds() - start;
}

void compare(const Field& field, const char* what, const FacetPoint& receiver, const char* target) {
    const MarchGrid grid = make_march_grid(bench::field(field.n, field.slope, field.correlation_cells));
    const double azimuth = std::atan2(1, 2), receivers = static_cast<double>(field.n) * field.n;
    std::vector<double> sweep_s, march_s;
    HorizonSlice sweep, march;
    for (int repeat = 0; repeat < 5; ++repeat) {
        sweep_s.push_back(timed([&] { sweep = compute_horizon(grid, azimuth, receiver, {}); }));
        if (repeat < 3)
            march_s.push_back(
                timed([&] { march = compute_horizon(grid, azimuth, receiver, {.exact = true}); }));
    }
    double squares = 0, wrong = 0;
    std::vector<double> errors;
    for (size_t k = 0; k < sweep.slope.size(); ++k) {
        const double error = std::abs(std::atan(double{sweep.slope[k]}) - std::atan(double{march.slope[k]}));
        squares += error * error;
        wrong += error > 1e-4;
        errors.push_back(error);
    }
    std::sort(errors.begin(), errors.end());
    const double sweep_ns = 1e9 * median(sweep_s) / receivers, march_ns = 1e9 * median(march_s) / receivers;
    std::printf("%s,%d,%.1f,%.0f,%s,%.1f,%.1f,%.1f,%.1e,%.1e,%.2f\n", target, field.n, field.slope,
                field.correlation_cells, what, sweep_ns, march_ns, march_ns / sweep_ns,
                std::sqrt(squares / receivers), errors[errors.size() * 99 / 100], 100 * wrong / receivers);
    std::fflush(stdout);
}

}  // namespace

int main() {
    std::printf(
        "# slope and distance, towards 26.57 deg\n"
        "target,n,slope,correlation_cells,receiver,sweep_ns,march_ns,ratio,rms_rad,p99_rad,wrong_percent\n");
    for (const char* target : {"AVX3", "AVX2", "SSE4"}) {
        if (!force_simd_target(target)) continue;
        for (const Field& field : {Field{128, 0.7, 8},
                                   {512, 0.7, 8},
                                   {1024, 0.7, 8},
                                   {2048, 0.7, 8},
                                   {1024, 0.3, 8},
                                   {1024, 1.5, 8},
                                   {1024, 0.7, 32},
                                   {2048, 0.7, 64}}) {
            compare(field, "node", node_receiver, target);
            compare(field, "facet", facet_point(0, 2.0 / 3, 1.0 / 3), target);
        }
    }
}
