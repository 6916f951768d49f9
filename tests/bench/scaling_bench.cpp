// Cost against the size of the surface at a fixed error: 64 x 64 table, albedo 0.8, 0.5 %, correlation length
// 8 cells, slope 0.7. Prints CPU and wall seconds, error, memory and where the time went. One size a process
// (peak memory is a process's): scaling_bench N
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>

#include "tests/bench/bench.h"

using namespace gonio;

int main(int argc, char** argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: scaling_bench N\n");
        return 2;
    }
    const int n = std::atoi(argv[1]);
    const HeightField surface = bench::field(n, 0.7);
    rusage before{};
    getrusage(RUSAGE_SELF, &before);
    BrdfPlan plan;
    plan.incident = plan.outgoing = bench::sixty_four_directions();
    plan.accuracy.target_relative_error = 0.005;
    const double cpu = bench::cpu_seconds(), wall = bench::wall_seconds();
    const BrdfResult r = measure_brdf(surface, bench::lambertian(0.8), plan, {1, true, 6LL << 30});
    const double cpu_used = bench::cpu_seconds() - cpu, wall_used = bench::wall_seconds() - wall;
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    std::printf("%d,%.2f,%.2f,%.2e,%.0f,%.0f", n, cpu_used, wall_used, r.report.relative_error,
                static_cast<double>(before.ru_maxrss) / 1024, static_cast<double>(usage.ru_maxrss) / 1024);
    for (const auto& [stage, seconds] : r.report.seconds) std::printf(",%s=%.2f", stage.c_str(), seconds);
    for (const auto& [key, value] : r.report.settings)
        if (key == "windows" || key == "directions" || key == "runs")
            std::printf(",%s=%s", key.c_str(), value.c_str());
    std::printf("\n");
}
