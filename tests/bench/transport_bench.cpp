// Every job of transport_jobs.h by each transport that can do it: CPU seconds foreseen and taken, the error
// reached, and which of them `auto` takes.
//     transport_bench [PART OF A NAME]
#include <cstdio>
#include <cstring>

#include "measure/prediction.h"
#include "tests/bench/bench.h"
#include "tests/bench/transport_jobs.h"

using namespace gonio;

namespace {

const char* setting(const Report& report, const char* name) {
    for (const auto& [key, value] : report.settings)
        if (key == name) return value.c_str();
    return "";
}

}  // namespace

int main(int argc, char** argv) {
    for (const bench::TransportJob& job : bench::transport_jobs()) {
        if (argc > 1 && !std::strstr(job.name, argv[1])) continue;
        const HeightField surface = job.surface();
        for (const auto& [kind, taken_before] : job.cpu_seconds) {
            BrdfPlan plan = job.plan;
            plan.transport = kind;
            const double foreseen = predict_brdf(surface, job.material, plan).cpu_seconds,
                         before = bench::cpu_seconds();
            const Report report = measure_brdf(surface, job.material, plan, {}).report;
            const double taken = bench::cpu_seconds() - before;
            std::printf(
                "%-28s %-16s foreseen %7.3f s, taken %7.3f s (once %.3f): %.2f; error %.2e, target %s\n",
                job.name, setting(report, "transport"), foreseen, taken, taken_before, foreseen / taken,
                report.relative_error, report.target_met ? "met" : "missed");
            std::fflush(stdout);
        }
    }
}
