// Projection to spherical harmonics of order 8: error (rms over the upper hemisphere, relative, mean over 12
// lights) from a quadrature grid and from scattered samples, and CPU time of a whole project() per light,
// table in memory. shared/performance_techniques 5 has the same figures of a first try: 0.10 ms a solve.
#include <cstdio>

#include "fitting/sh_projection.h"
#include "tests/bench/bench.h"
#include "tests/unit/projected_brdfs.h"

int main() {
    using namespace gonio;
    using namespace gonio::bench;
    using Form = ProjectionPlan::Form;
    const std::vector<AnglesDeg> lights = test::twelve_lights();
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
                const Table table = test::measured(plan, lights, brdf.f);
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
                            samples, projection.n_coefficients(),
                            test::true_error(projection, lights, brdf.f), stated, projection.condition_number,
                            1e3 * seconds / static_cast<double>(projection.n_sets()));
            }
}
