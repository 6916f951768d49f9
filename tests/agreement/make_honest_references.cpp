// Makes data/honest_NAME.json, the truth of honest_errors_test for the reliefs that have no closed form:
//     cmake --build build/dev --target make_honest_references && build/dev/bin/make_honest_references RELIEF
//     FACETS [cells] OUT.json
// Into cells: forward tracing, which has no grid and no lobes to resolve. Else the fast engine at settings
// far beyond those that are judged (each facet in 16 parts; 8192 directions and 8 runs, or 2048 and 10 for
// glossy facets), cross-checked by long runs of the path tracer, which shares nothing with it. A minute or
// two each.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "agreement/honest_surfaces.h"
#include "measure/reference.h"

using namespace gonio;

namespace {

// rms over the table of differences relative to the value, or to a hundredth of the mean.
double rms_relative(const std::vector<float>& difference_to, const std::vector<float>& f) {
    double sum = 0, mean = 0;
    for (const float value : f) mean += value / static_cast<double>(f.size());
    for (size_t k = 0; k < f.size(); ++k)
        sum += std::pow(difference_to[k] / std::max(static_cast<double>(f[k]), 0.01 * mean), 2) /
               static_cast<double>(f.size());
    return std::sqrt(sum);
}

nlohmann::json cross_check(const Table& reference, const Table& traced, long long paths) {
    double squares = 0, mean = 0;
    const size_t n_views = reference.outgoing.size(), n_lights = reference.incident.size();
    std::vector<double> of_view(n_views, 0.0);  // the lights of a view share its paths
    for (size_t k = 0; k < reference.f.size(); ++k) {
        squares += std::pow((traced.f[k] - reference.f[k]) / std::hypot(traced.se[k], reference.se[k]), 2) /
                   static_cast<double>(reference.f.size());
        of_view[reference.pair(k).second] +=
            (traced.f[k] / reference.f[k] - 1) / static_cast<double>(n_lights);
    }
    for (const double v : of_view) mean += v / static_cast<double>(n_views);
    double spread = 0;
    for (const double v : of_view) spread += (v - mean) * (v - mean) / static_cast<double>(n_views - 1);
    return {{"paths", paths},
            {"rms_relative_se", rms_relative(traced.se, traced.f)},
            {"rms_pull", std::sqrt(squares)},
            {"mean_relative_difference", mean},
            {"se_of_mean", std::sqrt(spread / static_cast<double>(n_views))}};
}

}  // namespace

int main(int argc, char** argv) {
    const bool cells = argc == 5 && std::string(argv[3]) == "cells";
    if (argc != 4 && !cells)
        return std::fprintf(stderr, "usage: %s RELIEF FACETS [cells] OUT.json\n", argv[0]), 1;
    const honest::Relief& field = honest::relief(argv[1]);
    const Material& material = honest::material(argv[2]);
    const HeightField surface = field.make();
    BrdfPlan plan = cells ? honest::cell_plan() : honest::plan();
    plan.accuracy.seed = 1'000'003;
    plan.accuracy.samples = cells                       ? Accuracy::Samples{64, 64, 1, 10}
                            : pure_lambertian(material) ? Accuracy::Samples{16, 8192, 4, 8}
                                                        : Accuracy::Samples{16, 2048, 4, 10};
    if (cells) plan.transport = TransportKind::forward;
    const BrdfResult result = measure_brdf(surface, material, plan, {});
    const Table& table = result.table;

    BrdfPlan other = plan;
    other.accuracy.samples.reset();
    const long long paths = cells ? 1'000'000 : 200'000;
    const Table traced = measure_reference(surface, material, other, {paths}, {}).table;

    nlohmann::json document = {{"name", field.name},
                               {"facets", argv[2]},
                               {"surface_hash", surface_hash(surface)},
                               {"command", std::string("make_honest_references ") + argv[1] + " " + argv[2] +
                                               (cells ? " cells" : "")},
                               {"rms_relative_se", rms_relative(table.se, table.f)},
                               {"rms_relative_bias", rms_relative(table.bias, table.f)},
                               {"path_tracer", cross_check(table, traced, paths)},
                               {"f", table.f}};
    for (const auto& [key, value] : result.report.settings) document["settings"][key] = value;
    std::ofstream(argv[argc - 1]) << document.dump(1) << "\n";
}
