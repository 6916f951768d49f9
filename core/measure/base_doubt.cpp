#include "measure/base_doubt.h"

#include <algorithm>
#include <cmath>

#include "surface/statistics.h"

namespace gonio {
namespace {

// Over tan^2 theta.
double doubt_of_slope(const HeightField& surface) {
    if (!surface.base.is_curved()) return 0;
    const SurfaceStatistics s = surface_statistics(surface);
    // Half the width where a relief does not end, as a groove along itself.
    double length = 0.5 * std::max(s.width, s.depth);
    for (const double own : {s.correlation_length_x, s.correlation_length_y})
        if (own > 0) length = std::min(length, own);
    return 0.15 / 8 * std::max(std::abs(surface.base.kappa_1), std::abs(surface.base.kappa_2)) *
           std::pow(std::max(s.pitch_x, s.pitch_y), 2) / length;
}

double doubt_of(double of_slope, const Vec3& d) {
    const double square = d.x * d.x + d.y * d.y;
    return std::min(1.0, of_slope * square / std::max(d.z * d.z, 1e-12));
}

std::vector<double> doubts_of_rows(const MeasuredScene& scene) {
    const double of_slope = doubt_of_slope(*scene.surface);
    std::vector<double> doubts;
    for (size_t r = 0; r < scene.rows(); ++r)
        doubts.push_back(std::hypot(doubt_of(of_slope, scene.lights[scene.groups.light[r]]),
                                    doubt_of(of_slope, scene.views[scene.groups.view[r]])));
    return doubts;
}

}  // namespace

double base_doubt(const HeightField& surface, const Vec3& direction) {
    return doubt_of(doubt_of_slope(surface), direction);
}

double base_doubt(const MeasuredScene& scene) {
    if (!scene.surface->base.is_curved()) return 0;
    double squares = 0;
    for (const double doubt : doubts_of_rows(scene)) squares += doubt * doubt;
    return std::sqrt(squares / static_cast<double>(scene.rows()));
}

void add_base_doubt(const MeasuredScene& scene, Estimate& e) {
    if (!scene.surface->base.is_curved()) return;
    const std::vector<double> doubts = doubts_of_rows(scene);
    for (size_t i = 0; i < e.bias.size(); ++i)
        e.bias[i] = std::hypot(e.bias[i], e.f[i] * doubts[i % scene.rows()]);
    e.systematic = std::hypot(e.systematic, base_doubt(scene));
    e.total = std::hypot(e.random, e.systematic);
}

}  // namespace gonio
