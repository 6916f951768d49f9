// Glossy and mixed facets: CPU time and error of the pair graph beside what the path tracer on Embree needs
// for the same error. One thread, one run; N = 128, correlation length 8, 64 x 64 directions. The error is
// the cosine-weighted rms over the table, over its mean, against a converged pair graph of other random
// numbers; the path tracer's over 8 of the views, with more and more paths until it is below the target: its
// time at the target lies between the last two.
//   glossy_bench [FIRST CASE [LAST CASE]]    with a path tracer: 0 to 3
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
    double target;
    Accuracy::Samples samples;  // 2 runs of them are measured
    bool traced;                // by the path tracer, too
};

// Seconds for a whole table at the target error, between the last two of more and more paths.
double path_tracer(const HeightField& surface, const Case& c, const Table& converged) {
    const auto all = bench::sixty_four_directions();
    std::vector<AnglesDeg> views;
    for (size_t k = 0; k < 8; ++k) views.push_back(all[8 * k + k]);
    double seconds_before = 0, error_before = 0;
    for (long long paths = 16384;; paths *= 2) {
        const double start = bench::cpu_seconds();
        const Table traced =
            measure_reference(surface, c.material, plan_of(views, c.samples, 3), {paths}, {}).table;
        const double seconds = 8 * (bench::cpu_seconds() - start), now = error(traced, converged);
        std::printf("    path tracer, %lld paths a view: %.1f s a table at %.3f %%\n", paths, seconds,
                    100 * now);
        std::fflush(stdout);
        if (now < c.target) {
            if (error_before == 0) return seconds;
            const double share = std::log(error_before / c.target) / std::log(error_before / now);
            return seconds_before * std::pow(seconds / seconds_before, share);
        }
        seconds_before = seconds;
        error_before = now;
    }
}

double run(const Case& c) {
    const HeightField surface = bench::field(128, c.slope);
    const Table converged = graph(surface, c.material, {8, 1024, 1, 4}, 77).table;
    graph(surface, c.material, {1, 32, 1, 2}, 5);  // warm
    double seconds = 0, error_of = 0;
    constexpr int repeats = 3;  // other random numbers each: mean time, rms error
    for (int k = 0; k < repeats; ++k) {
        const Timed found = graph(surface, c.material, c.samples, 1 + k);
        seconds += found.seconds / repeats;
        error_of += std::pow(error(found.table, converged), 2) / repeats;
    }
    std::printf("%-28s target %.1f %%: pair graph %.3f s at %.3f %%\n", c.name, 100 * c.target, seconds,
                100 * std::sqrt(error_of));
    if (c.traced) {
        const double traced = path_tracer(surface, c, converged);
        std::printf("    path tracer at %.1f %%: %.1f s, %.0f times\n", 100 * c.target, traced,
                    traced / seconds);
    }
    std::fflush(stdout);
    return seconds;
}

// 16 x 16 lights by 16 x 16 views, all orders; error against 16 of the views converged.
void sixteen_to_the_fourth() {
    const HeightField surface = bench::field(128, 0.5);
    std::vector<AnglesDeg> directions;
    for (int t = 0; t < 16; ++t)
        for (int a = 0; a < 16; ++a) directions.push_back({5.0 * t + 2.5, 22.5 * a + 1.7 * t});
    for (const auto& [name, material] :
         {std::pair{"GGX 0.3", Material({"y"}, ggx(0.3))}, {"Lambert", Material({"y"}, Lambertian{0.8})}}) {
        BrdfPlan plan;
        plan.incident = plan.outgoing = directions;
        plan.accuracy.target_relative_error = 0.005;
        const double start = bench::cpu_seconds();
        const BrdfResult found = measure_brdf(surface, material, plan, {});
        const double seconds = bench::cpu_seconds() - start;
        plan.outgoing.clear();
        for (size_t k = 0; k < 16; ++k) plan.outgoing.push_back(directions[17 * k]);
        plan.accuracy = {};
        plan.accuracy.samples = Accuracy::Samples{8, 512, 1, 4};
        plan.accuracy.seed = 77;
        const Table converged = measure_brdf(surface, material, plan, {}).table;
        std::printf("16^4, %s, target 0.5 %%: %.2f s, error stated %.3f %%, rms over mean %.3f %%\n", name,
                    seconds, 100 * found.report.relative_error, 100 * error(converged, found.table));
    }
}

}  // namespace
}  // namespace gonio

int main(int argc, char** argv) {
    using namespace gonio;
    const Accuracy::Samples equal{1, 42, 1, 2};
    const std::vector<Case> cases = {
        {"GGX 0.3", 0.5, {{"y"}, ggx(0.3)}, 0.003, {1, 42, 1, 2}, true},
        {"GGX 0.15", 0.5, {{"y"}, ggx(0.15)}, 0.01, {1, 90, 1, 2}, true},
        {"GGX 0.3, slope 0.7", 0.7, {{"y"}, ggx(0.3)}, 0.005, {1, 28, 1, 2}, true},
        {"half diffuse, half GGX 0.2", 0.5, half_diffuse(0.2), 0.003, equal, true},
        {"Lambert", 0.5, {{"y"}, Lambertian{0.8}}, 0.003, equal, false}};
    const size_t first = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 0,
                 last = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : cases.size();
    double mixture = 0;
    for (size_t k = first; k <= std::min(last, cases.size() - 1); ++k) {
        const double seconds = run(cases[k]);
        if (k == 3) mixture = seconds;
        if (k == 4 && mixture > 0) std::printf("    mixture over Lambert: %.2f\n", mixture / seconds);
    }
    if (last >= cases.size()) sixteen_to_the_fourth();
}
