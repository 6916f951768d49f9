// Who carries the light of a job, foreseen before it is done: the faster of those that can, and what the
// prediction says of its time.
#include "measure/transport_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "agreement/measured.h"
#include "bench/transport_jobs.h"
#include "measure/brdf_scene.h"
#include "measure/prediction.h"
#include "visibility/march_bounds.h"

namespace gonio {
namespace {

using bench::at_directions, bench::into_cells, bench::transport_jobs, bench::TransportJob;
using enum TransportKind;

Material ggx(double alpha) {
    return bench::ggx(alpha, alpha);
}
HeightField relief() {
    return bench::gaussian<32, 50, 4>();
}
TransportKind chosen(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                     std::string* why = nullptr) {
    const SimplifiedScene simple = simplify_brdf_scene(surface, material, true);
    const MarchGrid bounds = march_bounds(simple.surface);
    const TransportChoice choice = choose_transport(brdf_scene(simple, bounds, plan, {}));
    if (why)
        for (const auto& [key, value] : choice.report.settings)
            if (key == "transport_why") *why = value;
    return choice.kind;
}

TEST(TransportChoice, IsTheOnlyOneThatCanDoIt) {
    const Material gray({"y"}, Lambertian{0.5});
    std::string why;
    EXPECT_EQ(chosen(relief(), gray, at_directions(0.01), &why), diffuse);
    EXPECT_EQ(why, "all facets are Lambertian");
    for (const double alpha : {0.5, 1e-3})
        EXPECT_EQ(chosen(relief(), ggx(alpha), at_directions(0.01), &why), pair_graph);
    EXPECT_EQ(why, "facets are glossy");
    const Material mirror({"y"}, Mirror{{1.0, {}, {}}});
    EXPECT_EQ(chosen(relief(), mirror, into_cells(equal_cells(16), 0.01), &why), forward);
    EXPECT_EQ(why, "facets are mirrors");
    BrdfPlan forced = into_cells(equal_cells(16), 0.01);
    for (const TransportKind kind : {diffuse, pair_graph, forward}) {
        forced.transport = kind;
        EXPECT_EQ(chosen(relief(), gray, forced, &why), kind);
        EXPECT_EQ(why, "asked for");
    }
    HeightField curved = relief();
    curved.base.kappa_1 = 1000;
    EXPECT_EQ(chosen(curved, gray, into_cells(equal_cells(16), 0.01)), diffuse);
}

// Whoever is chosen took at most 1.5 times as long as the fastest.
TEST(TransportChoice, IsTheFasterOne) {
    int by_forward = 0, choices = 0;
    for (const TransportJob& job : transport_jobs()) {
        SCOPED_TRACE(job.name);
        std::string why;
        const TransportKind kind = chosen(job.surface(), job.material, job.plan, &why);
        double taken = 0, fastest = INFINITY;
        for (const auto& [possible, seconds] : job.cpu_seconds) {
            if (possible == kind) taken = seconds;
            fastest = std::min(fastest, seconds);
        }
        EXPECT_GT(taken, 0);
        EXPECT_LE(taken, 1.5 * fastest) << why;
        if (job.cpu_seconds.size() < 2) continue;
        ++choices;
        by_forward += kind == forward;
        // Both are named, the one that is taken first, with their figures.
        EXPECT_EQ(why.find("forward tracing: foreseen ") == 0, kind == forward) << why;
        EXPECT_NE(why.find("; "), std::string::npos) << why;
        EXPECT_NE(why.find(" % in "), std::string::npos) << why;
    }
    EXPECT_GT(by_forward, 0);
    EXPECT_LT(by_forward, choices);
}

// Within a factor of 3 of what they took, three quarters of them within 1.6: jobs on which nothing was
// fitted.
TEST(Prediction, IsAboutWhatJobsTake) {
    int jobs = 0, close = 0;
    for (const TransportJob& job : transport_jobs()) {
        SCOPED_TRACE(job.name);
        const HeightField surface = job.surface();
        BrdfPlan plan = job.plan;
        const TransportKind kind = chosen(surface, job.material, plan);
        for (const auto& [possible, seconds] : job.cpu_seconds) {
            plan.transport = possible;
            const double ratio = predict_brdf(surface, job.material, plan).cpu_seconds / seconds;
            std::printf("%-26s %d: %.2f\n", job.name, static_cast<int>(possible), ratio);
            // What is not taken needs to be right about that alone.
            if (job.fitted || possible != kind) continue;
            ++jobs;
            close += ratio > 1 / 1.6 && ratio < 1.6;
            EXPECT_GT(ratio, 1 / 2.5);
            EXPECT_LT(ratio, 2.5);
        }
    }
    EXPECT_GE(jobs, 12);
    EXPECT_GE(2 * close, jobs);
}

// At explicit samples, the smaller error. A lobe that no pair of shared directions meets has none of its
// light, and no spread to show for it.
TEST(TransportChoice, NarrowLobesGoToForwardTracing) {
    BrdfPlan plan = into_cells(equal_cells(16), 0.01);
    plan.accuracy = {};
    plan.accuracy.samples = Accuracy::Samples{2, 64, 1, 6};
    for (const double alpha : {1e-6, 1e-4}) EXPECT_EQ(chosen(relief(), ggx(alpha), plan), forward) << alpha;
    for (const double alpha : {0.3, 1.0}) EXPECT_EQ(chosen(relief(), ggx(alpha), plan), pair_graph) << alpha;
    // Nor is that error within a target that the rest would meet.
    for (const double alpha : {1e-6, 1e-4, 0.005})
        EXPECT_EQ(chosen(relief(), ggx(alpha), into_cells(equal_cells(16), 0.05)), forward) << alpha;
}

// What chains miss of narrow lobes is in what is foreseen, though runs that miss it alike agree.
TEST(TransportChoice, ForeseesWhatStatedErrorsDoNotTell) {
    BrdfPlan plan = at_directions(0.01);
    plan.accuracy = {};
    plan.accuracy.samples = Accuracy::Samples{64, 64, 1, 32};
    const auto foreseen = [&](double alpha) {
        const SimplifiedScene simple = simplify_brdf_scene(bench::gaussian<128, 50, 8>(), ggx(alpha), true);
        const MarchGrid bounds = march_bounds(simple.surface);
        return choose_transport(brdf_scene(simple, bounds, plan, {})).cost.relative_error;
    };
    EXPECT_LT(foreseen(0.3), 0.003);
    EXPECT_GT(foreseen(1e-3), 0.08);
}

// A job with another target may have runs in common, but not those of another transport.
TEST(TransportChoice, NamesRuns) {
    const Material gray({"y"}, Lambertian{0.5});
    const HeightField surface = relief();
    std::set<std::string> keys;
    for (const TransportKind kind : {diffuse, pair_graph, forward}) {
        BrdfPlan plan = into_cells(equal_cells(16), 0.01);
        plan.transport = kind;
        const SimplifiedScene simple = simplify_brdf_scene(surface, gray, true);
        const MarchGrid bounds = march_bounds(simple.surface);
        const TransportChoice choice = choose_transport(brdf_scene(simple, bounds, plan, {}));
        keys.insert(choice.transport->settings_key({}));
    }
    EXPECT_EQ(keys.size(), 3u);
}

// What is said is what is done, and a dry run says the same.
TEST(TransportChoice, IsToldByTheReport) {
    const BrdfPlan plan = into_cells(equal_cells(16), 0.05);
    std::string why, told;
    chosen(relief(), ggx(0.3), plan, &why);
    for (const auto& [key, value] : measure(relief(), ggx(0.3), plan).report.settings)
        if (key == "transport_why") told = value;
    EXPECT_EQ(told, why);
    EXPECT_EQ(told.find("pair graph: foreseen "), 0u) << told;
    BrdfPlan forced = plan;
    forced.transport = forward;
    EXPECT_LT(predict_brdf(relief(), ggx(0.3), plan).cpu_seconds,
              predict_brdf(relief(), ggx(0.3), forced).cpu_seconds);
}

}  // namespace
}  // namespace gonio
