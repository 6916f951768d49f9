// Curved bases: CPU seconds of the engine, its reported and its true error against Embree on the displaced
// patch, by base and radius; all orders at albedo 0.8 and the orders 1 and 2 alone. The flat table of the
// same job stands beside.
//   curved_bench [PATHS PER VIEW]
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "tests/agreement/curved_patch.h"
#include "tests/bench/bench.h"

using namespace gonio;

namespace {

constexpr int size = 64;
constexpr double target = 0.002;

struct Measured {
    Table table;
    double cpu = 0, reported = 0;
};

Measured measured(const HeightField& surface, double albedo, const std::vector<AnglesDeg>& lights,
                  const std::vector<AnglesDeg>& views, int orders) {
    BrdfPlan plan;
    plan.incident = lights;
    plan.outgoing = views;
    plan.accuracy.target_relative_error = target;
    plan.max_order = orders;
    plan.separate_orders = orders > 0;
    const double start = bench::cpu_seconds();
    BrdfResult r = measure_brdf(surface, bench::lambertian(albedo), plan, {1, true, 6LL << 30});
    return {std::move(r.table), bench::cpu_seconds() - start, r.report.relative_error};
}

}  // namespace

int main(int argc, char** argv) {
    const int paths = argc > 1 ? std::atoi(argv[1]) : 1000000;
    const std::vector<AnglesDeg> lights{{0, 0}, {30, 70}, {50, 180}, {65, 310}, {75, 20}, {80, 130}},
        views{{10, 40}, {45, 200}, {70, 300}, {80, 75}};
    std::vector<Vec3> wi;
    for (const AnglesDeg& light : lights) wi.push_back(to_vector(light));
    HeightField surface = bench::field(size, 0.7, 6);
    const double pitch = surface.pitch_x;
    std::printf(
        "base,radius_cells,cpu_s,flat_cpu_s,reported,error_all,error_1,error_2,doubt_of_truth_all,traced_cpu_"
        "s\n");
    const double flat_cpu = measured(surface, 0.8, lights, views, 0).cpu;
    for (const auto& [name, kappa_2, direction_deg] :
         {std::tuple{"cylinder", 0.0, 0.0}, {"cylinder at 30 deg", 0.0, 30.0}, {"sphere", 1.0, 0.0}})
        for (const double radius : {400.0, 200.0, 100.0, 60.0, -400.0}) {
            const double kappa = 1 / (radius * pitch);
            surface.base = {kappa, kappa_2 * kappa, radians(direction_deg)};
            const Measured all = measured(surface, 0.8, lights, views, 0),
                           apart = measured(surface, 1, lights, views, 2);
            const int core = kappa_2 == 0 ? size : size / 8;
            std::vector<std::unique_ptr<CurvedPatch>> owned;
            std::vector<CurvedPatch*> patches;
            for (int y = 0; y < size; y += core)
                for (int x = 0; x < size; x += core) {
                    owned.push_back(std::make_unique<CurvedPatch>(surface, x, y, core, 96));
                    patches.push_back(owned.back().get());
                }
            const double start = bench::cpu_seconds();
            double squares[4] = {};
            for (size_t v = 0; v < views.size(); ++v) {
                const auto traced = trace_view(patches, wi, to_vector(views[v]), 2, 0.8, paths, 10 + v);
                for (size_t l = 0; l < lights.size(); ++l) {
                    const size_t row = l * views.size() + v;
                    auto add = [&](int which, double f, const TracedOrders::Value& truth) {
                        squares[which] += std::pow(f / truth.mean - 1, 2);
                    };
                    add(0, all.table.f[all.table.index(0, 0, row)], traced[l].all);
                    for (int k = 0; k < 2; ++k)
                        add(k + 1, apart.table.f[apart.table.index(0, k + 1, row)], traced[l].orders[k]);
                    squares[3] += std::pow(traced[l].all.se / traced[l].all.mean, 2);
                }
            }
            const double n = static_cast<double>(lights.size() * views.size());
            std::printf("%s,%g,%.2f,%.2f,%.5f,%.5f,%.5f,%.5f,%.5f,%.1f\n", name, radius, all.cpu, flat_cpu,
                        all.reported, std::sqrt(squares[0] / n), std::sqrt(squares[1] / n),
                        std::sqrt(squares[2] / n), std::sqrt(squares[3] / n), bench::cpu_seconds() - start);
            std::fflush(stdout);
        }
}
