// The main figure: CPU time of a whole 64 x 64 table (Lambertian 0.8, all orders) against its true error, and
// what the path tracer would need for the same error. One thread, one run, both sides interleaved.
//
//   table_bench FOLDER                  measures; writes FOLDER/table_bench.csv and .svg; reads the converged
//   answers stored beside this file table_bench --references FOLDER N   makes those answers: N paths from
//   each of 4 views, shared by 64 lights (minutes a case)
//
// True error: rms relative difference over 4 views x 64 lights, the reference's own variance taken off. The
// path tracer's error is its standard error (tests/agreement shows that it is honest), carried to other path
// counts by n^-1/2: where a time is extrapolated, the table says so.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "clients/plot/plot.h"
#include "measure/reference.h"
#include "tests/bench/bench.h"

using namespace gonio;

namespace {

struct Case {
    const char* name;
    double slope, correlation_cells;
};
constexpr Case cases[] = {
    {"slope 0.3", 0.3, 8}, {"slope 0.7", 0.7, 8}, {"slope 1.5", 1.5, 8}, {"slope 0.7, l = 2", 0.7, 2}};
constexpr int n = 128, reference_views[4] = {1, 27, 45, 15};

struct Answers {
    std::vector<double> f, se;  // [light][view of reference_views]
};

BrdfPlan table_plan() {
    BrdfPlan plan;
    plan.incident = plan.outgoing = bench::sixty_four_directions();
    return plan;
}

BrdfPlan four_views() {
    BrdfPlan plan = table_plan();
    plan.outgoing.clear();
    for (const int v : reference_views) plan.outgoing.push_back(plan.incident[v]);
    return plan;
}

std::string answers_path(const std::string& folder, int c) {
    return folder + "/reference_" + std::to_string(c) + ".csv";
}

Answers read_answers(const std::string& folder, int c) {
    Answers answers;
    std::ifstream file(answers_path(folder, c));
    std::string line;
    while (std::getline(file, line)) {
        if (line.empty() || line[0] == '#') continue;
        std::istringstream fields(line);
        double f, se;
        char comma;
        if (fields >> f >> comma >> se) {
            answers.f.push_back(f);
            answers.se.push_back(se);
        }
    }
    return answers;
}

double rms_relative_se(const Table& t) {
    double sum = 0;
    for (size_t i = 0; i < t.rows(); ++i)
        sum += std::pow(t.se[i] / t.f[i], 2) / static_cast<double>(t.rows());
    return std::sqrt(sum);
}

void make_references(const std::string& folder, long long paths) {
    for (int c = 0; c < 4; ++c) {
        BrdfPlan plan = four_views();
        plan.accuracy.seed = 77;
        const BrdfResult r = measure_reference(bench::field(n, cases[c].slope, cases[c].correlation_cells),
                                               bench::lambertian(0.8), plan, {paths}, {2, true, 6LL << 30});
        std::ofstream file(answers_path(folder, c));
        file.precision(9);
        file << "# " << cases[c].name << ", path tracer, " << paths
             << " paths a view, seed 77; 64 lights x 4 views, light slowest: f, se\n";
        for (size_t i = 0; i < r.table.rows(); ++i) file << r.table.f[i] << ',' << r.table.se[i] << '\n';
        std::printf("%s: rms relative se %.2e\n", cases[c].name, rms_relative_se(r.table));
        std::fflush(stdout);
    }
}

double true_error(const Table& table, const Answers& answers) {
    double sum = 0;
    for (size_t l = 0; l < 64; ++l)
        for (size_t v = 0; v < 4; ++v) {
            const double truth = answers.f[l * 4 + v],
                         relative = table.f[l * 64 + reference_views[v]] / truth - 1,
                         doubt = answers.se[l * 4 + v] / truth;
            sum += (relative * relative - doubt * doubt) / 256;
        }
    return std::sqrt(std::max(sum, 0.0));
}

}  // namespace

int main(int argc, char** argv) {
    const std::string data = GONIO_BENCH_DATA;
    if (argc == 4 && std::string(argv[1]) == "--references") {
        make_references(argv[2], std::atoll(argv[3]));
        return 0;
    }
    if (argc != 2) {
        std::fprintf(stderr, "usage: table_bench FOLDER | table_bench --references FOLDER PATHS\n");
        return 2;
    }
    const std::string folder = argv[1];
    std::ofstream csv(folder + "/table_bench.csv");
    auto line = [&](const std::string& text) {
        std::printf("%s\n", text.c_str());
        std::fflush(stdout);
        csv << text << '\n';
    };
    auto format = [](const char* pattern, auto... values) {
        char text[256];
        std::snprintf(text, sizeof text, pattern, values...);
        return std::string(text);
    };
    line(
        "# 64 x 64 table, albedo 0.8, all orders, N = 128, one thread, CPU seconds; pt_seconds: path tracer "
        "at the same true error (n^-1/2)");
    line("case,target,gonio_seconds,reported_error,true_error,reference_error,pt_seconds,ratio");
    std::vector<PlotSeries> series;
    for (int c = 0; c < 4; ++c) {
        const HeightField surface = bench::field(n, cases[c].slope, cases[c].correlation_cells);
        const Answers answers = read_answers(data, c);
        if (answers.f.size() != 256) {
            std::fprintf(stderr, "no reference for %s in %s\n", cases[c].name, data.c_str());
            return 1;
        }
        double doubt = 0;
        for (size_t i = 0; i < 256; ++i) doubt += std::pow(answers.se[i] / answers.f[i], 2) / 256;
        // The rival: 4 of the 64 views, so its time for the table is 16 times as long.
        BrdfPlan rival = four_views();
        const double start = bench::cpu_seconds();
        const BrdfResult traced =
            measure_reference(surface, bench::lambertian(0.8), rival, {32768}, {1, true, 6LL << 30});
        const double pt_seconds = 16 * (bench::cpu_seconds() - start),
                     pt_error = rms_relative_se(traced.table);
        for (const auto& [key, value] : traced.report.counters)
            if (key.find("CPU second") != std::string::npos)
                line(format("# %s: path tracer %.1f s a table at %.2e; %s %.2f", cases[c].name, pt_seconds,
                            pt_error, key.c_str(), value));
        PlotSeries gonio{std::string("gonio, ") + cases[c].name, {}, {}, false, c},
            path{std::string("path tracer, ") + cases[c].name, {}, {}, true, c};
        for (const double target : {0.01, 0.003, 0.001}) {
            std::vector<double> seconds, errors, reported;
            for (int seed = 1; seed <= 3; ++seed) {
                BrdfPlan plan = table_plan();
                plan.accuracy.target_relative_error = target;
                plan.accuracy.seed = seed;
                const double begin = bench::cpu_seconds();
                const BrdfResult r =
                    measure_brdf(surface, bench::lambertian(0.8), plan, {1, true, 6LL << 30});
                seconds.push_back(bench::cpu_seconds() - begin);
                errors.push_back(true_error(r.table, answers));
                reported.push_back(r.report.relative_error);
            }
            auto median = [](std::vector<double> v) {
                std::sort(v.begin(), v.end());
                return v[v.size() / 2];
            };
            // Below the reference's own error nothing can be told apart: it is then the bound that is used,
            // against gonio.
            const double time = median(seconds), error = std::max(median(errors), std::sqrt(doubt)),
                         needed = pt_seconds * std::pow(pt_error / error, 2);
            line(format("\"%s\",%g,%.3f,%.2e,%.2e,%.2e,%.1f,%.0f", cases[c].name, target, time,
                        median(reported), median(errors), std::sqrt(doubt), needed, needed / time));
            gonio.x.push_back(time);
            gonio.y.push_back(error);
            path.x.push_back(needed);
            path.y.push_back(error);
        }
        series.push_back(gonio);
        series.push_back(path);
    }
    plot_lines(
        series, folder + "/table_bench.svg",
        {"Error against CPU time, 64 x 64 table, all orders", "CPU seconds, one thread", "rms relative error",
         "N = 128, Gaussian relief, albedo 0.8; dashed: path tracer on Embree, paths shared by all lights, "
         "by n^-1/2"});

    // Klems full basis, 145 x 145.
    BrdfPlan klems;
    klems.incident = klems.outgoing = klems_full();
    klems.accuracy.target_relative_error = 0.003;
    const HeightField surface = bench::field(n, 0.7);
    double begin = bench::cpu_seconds();
    const BrdfResult r = measure_brdf(surface, bench::lambertian(0.8), klems, {1, true, 6LL << 30});
    const double klems_seconds = bench::cpu_seconds() - begin;
    BrdfPlan few = klems;
    few.outgoing = {klems.outgoing[5], klems.outgoing[50], klems.outgoing[90], klems.outgoing[120]};
    begin = bench::cpu_seconds();
    const BrdfResult traced =
        measure_reference(surface, bench::lambertian(0.8), few, {8192}, {1, true, 6LL << 30});
    const double pt = (bench::cpu_seconds() - begin) * 145 / 4, pt_error = rms_relative_se(traced.table);
    line(
        format("# Klems full 145 x 145: %.3f s, reported %.2e; path tracer %.1f s at %.2e, %.0f s at the "
               "reported error: ratio %.0f",
               klems_seconds, r.report.relative_error, pt, pt_error,
               pt * std::pow(pt_error / r.report.relative_error, 2),
               pt * std::pow(pt_error / r.report.relative_error, 2) / klems_seconds));

    // Two threads against one, the whole job, wall seconds, interleaved; and the same for two independent
    // copies of the same spin: what the machine allows.
    double one = 1e30, two = 1e30, spin_one = 1e30, spin_two = 1e30;
    for (int repeat = 0; repeat < 5; ++repeat) {
        BrdfPlan plan = table_plan();
        plan.accuracy.target_relative_error = 0.001;
        for (const int threads : {1, 2}) {
            begin = bench::wall_seconds();
            measure_brdf(surface, bench::lambertian(0.8), plan, {threads, true, 6LL << 30});
            double& best = threads == 1 ? one : two;
            best = std::min(best, bench::wall_seconds() - begin);
            begin = bench::wall_seconds();
            parallel_for(2, threads, [](int) {
                volatile double x = 1;
                for (int k = 0; k < 50000000; ++k) x = x * 1.0000001;
            });
            double& spin = threads == 1 ? spin_one : spin_two;
            spin = std::min(spin, bench::wall_seconds() - begin);
        }
    }
    line(
        format("# two threads against one: %.2f times (%.3f s to %.3f s); two independent spins on this "
               "machine: %.2f times",
               one / two, one, two, spin_one / spin_two));

    // A plane is answered in closed form.
    begin = bench::wall_seconds();
    BrdfPlan plan = table_plan();
    measure_brdf(generate_plane(128, 1e-6), bench::lambertian(0.8), plan, {1, true, 6LL << 30});
    line(format("# plane, 64 x 64 table: %.3f ms", 1e3 * (bench::wall_seconds() - begin)));
}
