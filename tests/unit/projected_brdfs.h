// Analytic reflectances measured for a projection, and how far what is reconstructed is from them.
#pragma once
#include "fitting/projection_directions.h"
#include "fitting/sh_projection.h"
#include "unit/test_brdfs.h"

namespace gonio::test {

// The exact table of the directions that the projection asks for.
template <class F>
Table measured(const ProjectionPlan& project, const std::vector<AnglesDeg>& lights, const F& f,
               uint64_t seed = 1) {
    BrdfPlan plan;
    plan.incident = lights;
    plan.project = project;
    plan.accuracy.seed = seed;
    set_projection_directions(plan);
    Table table;
    table.incident = plan.incident;
    table.outgoing = plan.outgoing;
    table.pairs = plan.pairs;
    test::fill(table, f);
    return table;
}

inline std::vector<AnglesDeg> twelve_lights() {
    std::vector<AnglesDeg> lights;
    for (int k = 0; k < 12; ++k) lights.push_back({5 + 6.5 * k, 17});
    return lights;
}

// rms of the reconstructed g against the true one over the upper hemisphere, relative, mean over lights
// (performance_techniques 5).
template <class F>
double true_error(const HarmonicProjection& projection, const std::vector<AnglesDeg>& lights, const F& f) {
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
            const double value = f(wi, wo), weight = wi.z * wo.z;
            error += std::pow((table.f[i * views.size() + o] - value) * weight, 2);
            total += std::pow(value * weight, 2);
        }
        mean += std::sqrt(error / total) / static_cast<double>(lights.size());
    }
    return mean;
}

}  // namespace gonio::test
