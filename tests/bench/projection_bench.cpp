// Projection to spherical harmonics of order 8: error (rms over the upper hemisphere, relative, mean over 12
// lights) from a quadrature grid and from scattered samples, and CPU time of a whole project() per light,
// table in memory. shared/performance_techniques 5 has the same figures of a first try: 0.10 ms a solve.
#include <cstdio>

#include "fitting/projection_directions.h"
#include "fitting/sh_projection.h"
#include "tests/bench/bench.h"
#include "tests/unit/test_brdfs.h"

namespace gonio::bench {
namespace {

using Form = ProjectionPlan::Form;

Table measured(const ProjectionPlan& project, const std::vector<AnglesDeg>& lights,
               const test::TestBrdf& brdf) {
    BrdfPlan plan;
    plan.incident = lights;
    plan.project = project;
    set_projection_directions(plan);
    Table table;
    table.incident = plan.incident;
    table.outgoing = plan.outgoing;
    table.pairs = plan.pairs;
    test::fill(table, brdf.f);
    return table;
}

double error_of(const HarmonicProjection& projection, const std::vector<AnglesDeg>& lights,
                const test::TestBrdf& brdf) {
    std::vector<AnglesDeg> views;
    for (int i = 0; i < 40; ++i)
        for (int j = 0; j < 64; ++j)
            views.push_back({degrees(std::acos((i + 0.5) / 40)), 360 * (j + 0.3) / 64});
    const Table table = reconstruct(projection, lights, views);
    double mean = 0;
    for (size_t i = 0; i < lights.size(); ++i) {
        double error = 0, total = 0;
        for (size_t o = 0; o < views.size(); ++o) {
            const Vec3 wi = to_vector(lights[i]), wo = to_vector(views[o]);
            const double f = brdf.f(wi, wo);
            error += std::pow((table.f[i * views.size() + o] - f) * wo.z, 2);
            total += std::pow(f * wo.z, 2);
        }
        mean += std::sqrt(error / total) / static_cast<double>(lights.size());
    }
    return mean;
}

}  // namespace
}  // namespace gonio::bench

int main() {
    using namespace gonio;
    using namespace gonio::bench;
    std::vector<AnglesDeg> lights;
    for (int k = 0; k < 12; ++k) lights.push_back({5 + 6.5 * k, 17});
    std::printf("brdf,basis,form,samples,coefficients,error,stated_error,condition_number,ms_per_light\n");
    for (const auto& brdf : test::test_brdfs())
        for (const auto basis : {ProjectionPlan::Basis::sh, ProjectionPlan::Basis::hsh})
            for (const auto& [form, samples] : {std::pair{Form::per_light, 0},
                                                {Form::per_light, 100},
                                                {Form::per_light, 400},
                                                {Form::matrix, 0},
                                                {Form::matrix, 400},
                                                {Form::joint, 0},
                                                {Form::joint, 400},
                                                {Form::joint, 1600}}) {
                ProjectionPlan plan;
                plan.basis = basis;
                plan.form = form;
                plan.samples = samples;
                const Table table = measured(plan, lights, brdf);
                const double start = cpu_seconds();
                const HarmonicProjection projection = project(table, plan);
                const double seconds = cpu_seconds() - start;
                double stated = 0;
                for (const double e : projection.relative_error)
                    stated += e / static_cast<double>(projection.relative_error.size());
                std::printf("%s,%s,%s,%d,%zu,%.4f,%.4f,%.3g,%.2f\n", brdf.name.c_str(),
                            basis == ProjectionPlan::Basis::sh ? "sh" : "hsh",
                            form == Form::per_light ? "per_light"
                            : form == Form::matrix  ? "matrix"
                                                    : "joint",
                            samples, projection.n_coefficients(), error_of(projection, lights, brdf), stated,
                            projection.condition_number,
                            1e3 * seconds / static_cast<double>(projection.n_sets()));
            }
}
