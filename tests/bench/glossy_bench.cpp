// Glossy and mixed facets: CPU time and error of the pair graph beside what the path tracer on Embree needs
// for the same error. One thread, one run; N = 128, correlation length 8, 64 x 64 directions. The error is
// the cosine-weighted rms over the table, over its mean, against a converged pair graph of other random
// numbers; the path tracer's is its own rms distance from that over 8 of the views, carried to other path
// counts as n^-1/2.
//   glossy_bench [PATHS] [FIRST CASE]    PATHS 0: no path tracer
#include <cstdio>
#include <cstdlib>

#include "measure/reference.h"
#include "tests/bench/bench.h"

namespace gonio {
namespace {

Lobe ggx(double alpha) {
    Microfacet m;
    m.alpha_x = m.alpha_y = alpha;
    m.reflectance.reflectance = 1.0;
    return m;
}

Material half_diffuse(double alpha) {
    Material material({"y"}, Lambertian{1.0});
    material.lobes.front().weight = 0.5;
    material.lobes.push_back({0.5, ggx(alpha)});
    return material;
}

struct Timed {
    Table table;
    double seconds = 0;
};

BrdfPlan plan_of(std::vector<AnglesDeg> outgoing, Accuracy::Samples samples, uint64_t seed) {
    BrdfPlan plan;
    plan.incident = bench::sixty_four_directions();
    plan.outgoing = std::move(outgoing);
    plan.transport = TransportKind::pair_graph;
    plan.accuracy.samples = samples;
    plan.accuracy.seed = seed;
    return plan;
}

Timed graph(const HeightField& surface, const Material& material, Accuracy::Samples samples, uint64_t seed) {
    const double start = bench::cpu_seconds();
    Table table =
        measure_brdf(surface, material, plan_of(bench::sixty_four_directions(), samples, seed), {}).table;
    return {std::move(table), bench::cpu_seconds() - start};
}

// Rows of `table` against those of the full table with the same directions.
double error(const Table& table, const Table& full) {
    double squares = 0, weights = 0, mean = 0;
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        const auto at = std::find(full.outgoing.begin(), full.outgoing.end(), table.outgoing[o]);
        const float f = full.f[i * full.outgoing.size() + static_cast<size_t>(at - full.outgoing.begin())];
        const double w = to_vector(table.incident[i]).z * to_vector(table.outgoing[o]).z;
        squares += w * (table.f[row] - f) * (table.f[row] - f);
        mean += w * f;
        weights += w;
    }
    return std::sqrt(squares / weights) / (mean / weights);
}

struct Case {
    const char* name;
    double slope;
    Material material;
    Accuracy::Samples samples;  // 2 runs of them are measured
};

void run(const Case& c, long long paths) {
    const HeightField surface = bench::field(128, c.slope);
    const Table converged = graph(surface, c.material, {8, 1024, 1, 4}, 77).table;
    graph(surface, c.material, {1, 32, 1, 2}, 5);  // warm
    const Timed found = graph(surface, c.material, c.samples, 1);
    const double own = error(found.table, converged);
    std::printf("%-28s graph %.3f s at %.3f %%", c.name, found.seconds, 100 * own);
    if (paths > 0) {
        const auto all = bench::sixty_four_directions();
        std::vector<AnglesDeg> views;
        for (size_t k = 0; k < 8; ++k) views.push_back(all[8 * k + k]);
        const double start = bench::cpu_seconds();
        const Table traced =
            measure_reference(surface, c.material, plan_of(views, c.samples, 3), {paths}, {}).table;
        const double seconds = 8 * (bench::cpu_seconds() - start), off = error(traced, converged);
        std::printf("; path tracer %.1f s a table at %.3f %%; %.0f times", seconds, 100 * off,
                    seconds * std::pow(off / own, 2) / found.seconds);
    }
    std::printf("\n");
    std::fflush(stdout);
}

}  // namespace
}  // namespace gonio

int main(int argc, char** argv) {
    using namespace gonio;
    const long long paths = argc > 1 ? std::atoll(argv[1]) : 4096;
    const std::vector<Case> cases = {{"GGX 0.3", 0.5, {{"y"}, ggx(0.3)}, {1, 54, 1, 2}},
                                     {"GGX 0.15", 0.5, {{"y"}, ggx(0.15)}, {1, 126, 1, 2}},
                                     {"GGX 0.3, slope 0.7", 0.7, {{"y"}, ggx(0.3)}, {1, 54, 1, 2}},
                                     {"half diffuse, half GGX 0.2", 0.5, half_diffuse(0.2), {1, 54, 1, 2}},
                                     {"Lambert", 0.5, {{"y"}, Lambertian{0.8}}, {1, 54, 1, 2}}};
    const size_t first = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 0;
    for (size_t k = first; k < cases.size(); ++k) run(cases[k], paths);
}
