// Jobs by which the choice of a transport and its predictions are judged, with the CPU seconds that they took
// by each transport that can do them: transport_bench measures them anew.
#pragma once
#include <utility>
#include <vector>

#include "directions/cells.h"
#include "directions/gonio_grid.h"
#include "measure/brdf.h"
#include "surface/generate.h"

namespace gonio::bench {

struct TransportJob {
    const char* name;
    bool fitted;  // a constant of measure/forecast.cpp was measured on such a relief with such facets
    HeightField (*surface)();
    Material material;
    BrdfPlan plan;
    // One core (AVX-512, but AVX2 for GGX 0.02 to 0.08 by the pair graph) of a busy machine, one thread; seeds
    // fixed.
    std::vector<std::pair<TransportKind, double>> cpu_seconds;
};

inline Material ggx(double alpha_x, double alpha_y) {
    return {{"y"}, Microfacet{Microfacet::Distribution::ggx, alpha_x, alpha_y, 0.0, {1.0, {}, {}}}};
}
inline Material half_ggx(double alpha) {
    Material material({"y"}, Lambertian{1.0});
    material.lobes.front().weight = 0.5;
    material.lobes.push_back({0.5, ggx(alpha, alpha).lobes.front().lobe});
    return material;
}

inline BrdfPlan to_target(BrdfPlan plan, double target) {
    plan.accuracy.target_relative_error = target;
    return plan;
}
// 16 lights, 16 views.
inline BrdfPlan at_directions(double target) {
    BrdfPlan plan;
    plan.incident = equal_projected_hemisphere(16);
    plan.outgoing = product_grid({15, 40, 65, 80}, {20, 110, 200, 290});
    return to_target(std::move(plan), target);
}
// 16 lights.
inline BrdfPlan into_cells(std::vector<ReceiverCell> cells, double target) {
    BrdfPlan plan;
    plan.incident = equal_projected_hemisphere(16);
    plan.outgoing = centres(cells);
    plan.outgoing_cells = std::move(cells);
    return to_target(std::move(plan), target);
}

// Gaussian reliefs: cells a side, rms slope, correlation length in cells.
template <int n, int slope_percent, int correlation>
HeightField gaussian() {
    return generate_gaussian(n, n, 1e-6, correlation * 1e-6, 0.01 * slope_percent, 1);
}

inline std::vector<TransportJob> transport_jobs() {
    using enum TransportKind;
    const Material white({"y"}, Lambertian{0.8}), mirror({"y"}, Mirror{{1.0, {}, {}}}),
        beckmann({"y"}, Microfacet{Microfacet::Distribution::beckmann, 0.3, 0.3, 0.0, {1.0, {}, {}}}),
        coat({"y"}, CoatedDiffuse{1.5, 0.15, 0.8});
    return {
        {"Lambert, 64 cells",
         true,
         gaussian<128, 50, 8>,
         white,
         into_cells(equal_cells(64), 0.02),
         {{diffuse, 0.90}, {forward, 2.28}}},
        {"GGX 0.3, 64 cells",
         true,
         gaussian<128, 50, 8>,
         ggx(0.3, 0.3),
         into_cells(equal_cells(64), 0.02),
         {{pair_graph, 2.01}, {forward, 5.47}}},
        {"GGX 0.1, 64 cells",
         true,
         gaussian<128, 50, 8>,
         ggx(0.1, 0.1),
         into_cells(equal_cells(64), 0.02),
         {{pair_graph, 3.73}, {forward, 14.1}}},
        {"GGX 0.03, 32 cells",
         true,
         gaussian<64, 80, 4>,
         ggx(0.03, 0.03),
         into_cells(equal_cells(32), 0.06),
         {{pair_graph, 1.85}, {forward, 1.16}}},
        {"GGX 0.02, 32 cells",
         false,
         gaussian<64, 50, 8>,
         ggx(0.02, 0.02),
         into_cells(equal_cells(32), 0.05),
         {{pair_graph, 3.11}, {forward, 22.5}}},
        {"GGX 0.22, 32 cells",
         false,
         gaussian<96, 60, 6>,
         ggx(0.22, 0.22),
         into_cells(equal_cells(32), 0.015),
         {{pair_graph, 0.77}, {forward, 4.86}}},
        {"GGX 0.08, 32 cells",
         false,
         gaussian<96, 60, 6>,
         ggx(0.08, 0.08),
         into_cells(equal_cells(32), 0.04),
         {{pair_graph, 1.19}, {forward, 1.20}}},
        {"brushed GGX, 32 cells",
         false,
         gaussian<96, 60, 6>,
         ggx(0.1, 0.4),
         into_cells(equal_cells(32), 0.02),
         {{pair_graph, 0.93}, {forward, 3.01}}},
        {"Beckmann 0.3, 16 cells",
         true,
         gaussian<64, 80, 4>,
         beckmann,
         into_cells(equal_cells(16), 0.02),
         {{pair_graph, 0.39}, {forward, 2.69}}},
        {"Phong 50, 16 cells",
         false,
         gaussian<64, 80, 4>,
         {{"y"}, Phong{50.0, 0.9}},
         into_cells(equal_cells(16), 0.04),
         {{pair_graph, 0.34}, {forward, 0.45}}},
        {"coat 0.15, 16 cells",
         false,
         gaussian<64, 80, 4>,
         coat,
         into_cells(equal_cells(16), 0.03),
         {{pair_graph, 0.30}, {forward, 0.59}}},
        {"half GGX 0.1, Klems",
         false,
         gaussian<64, 80, 4>,
         half_ggx(0.1),
         into_cells(klems_full_cells(), 0.03),
         {{pair_graph, 1.02}, {forward, 4.32}}},
        {"Lambert, Klems",
         false,
         gaussian<96, 60, 6>,
         white,
         into_cells(klems_full_cells(), 0.015),
         {{diffuse, 0.81}, {forward, 8.14}}},
        {"mirror, Klems",
         false,
         gaussian<96, 60, 6>,
         mirror,
         into_cells(klems_full_cells(), 0.02),
         {{forward, 0.58}}},
        {"brushed GGX, directions",
         false,
         gaussian<96, 60, 6>,
         ggx(0.1, 0.4),
         at_directions(0.01),
         {{pair_graph, 0.165}}},
        {"Beckmann 0.3, directions",
         false,
         gaussian<64, 80, 4>,
         beckmann,
         at_directions(0.008),
         {{pair_graph, 0.192}}},
        {"coat 0.15, directions",
         false,
         gaussian<64, 80, 4>,
         coat,
         at_directions(0.01),
         {{pair_graph, 0.18}}},
        {"half GGX 0.1, directions",
         false,
         gaussian<256, 40, 10>,
         half_ggx(0.1),
         at_directions(0.01),
         {{pair_graph, 1.29}}},
        {"coat 0.3, directions",
         true,
         gaussian<128, 50, 8>,
         {{"y"}, CoatedDiffuse{1.5, 0.3, 0.8}},
         at_directions(0.005),
         {{pair_graph, 0.33}}},
        {"GGX 0.15, directions",
         true,
         gaussian<128, 50, 8>,
         ggx(0.15, 0.15),
         at_directions(0.005),
         {{pair_graph, 0.52}}},
    };
}

}  // namespace gonio::bench
