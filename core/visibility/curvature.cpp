#include "visibility/curvature.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "base/error.h"

namespace gonio {
namespace {

constexpr double most_height = 0.5;  // |kappa| times the height over the base
constexpr double most_cell = 0.25;   // |kappa| times the pitch

std::string text_of(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", x);
    return text;
}

}  // namespace

double bent_horizon_slope(double slope, double distance, double height, double kappa,
                          HorizonCorrection correction) {
    const double occluder = height + distance * slope, turn = kappa * distance;
    if (correction == HorizonCorrection::printed) return slope * (1 - kappa * occluder) - turn / 2;
    // [(R + h) cos(d / R) - (R + h0)] / [(R + h) sin(d / R)], without a difference of large numbers.
    const double half = std::sin(turn / 2), sinc = turn == 0 ? 1 : std::sin(turn) / turn;
    const double drop = turn == 0 ? 0 : 2 * half * half / turn;
    return (slope / (1 + kappa * occluder) - drop) / sinc;
}

double terminator_slope(double height, double kappa) {
    if (!(kappa > 0)) return -std::numeric_limits<double>::infinity();
    const double secant = 1 + kappa * std::max(height, 0.0);
    return -std::sqrt((secant - 1) * (secant + 1));
}

double corrected_horizon_slope(double slope, double distance, double height, double kappa,
                               HorizonCorrection correction) {
    const double end = terminator_slope(height, kappa);
    if (!(distance > 0)) return kappa > 0 ? end : 0;
    if (kappa * distance >= pi / 2) return end;  // behind the base
    return std::max(end, bent_horizon_slope(slope, distance, height, kappa, correction));
}

Vec3 turned_direction(const Vec3& direction, double turn, double axis_x, double axis_y) {
    const double along = direction.x * axis_x + direction.y * axis_y;
    const double c = std::cos(turn), s = std::sin(turn);
    const double more = along * (c - 1) - direction.z * s;
    return {direction.x + more * axis_x, direction.y + more * axis_y, direction.z * c + along * s};
}

Vec3 turned_direction(const Vec3& direction, const BaseCurvature& base, double x, double y) {
    const BaseCurvature::Tensor k = base.tensor();
    const double turn_x = k.xx * x + k.xy * y, turn_y = k.xy * x + k.yy * y,
                 turn = std::hypot(turn_x, turn_y);
    if (turn == 0) return direction;
    return turned_direction(direction, turn, turn_x / turn, turn_y / turn);
}

Vec3 view_at_height(const Vec3& view, const BaseCurvature& base, double from, double at) {
    const double horizontal = std::hypot(view.x, view.y);
    if (horizontal == 0) return view;
    // (R + from + s view.z)^2 + (s horizontal)^2 = (R + at)^2, times the curvature; of its roots the upper
    // one.
    const double kappa = base.along(view.x, view.y), b = view.z * (1 + kappa * from),
                 q = (from - at) * (2 + kappa * (from + at)), s = -q / (b + safe_sqrt(b * b - kappa * q)),
                 out = s * horizontal, turn = std::atan2(kappa * out, 1 + kappa * (from + s * view.z)),
                 distance = kappa == 0 ? out : turn / kappa;
    return turned_direction(view, base, distance * view.x / horizontal, distance * view.y / horizontal);
}

void check_base(const HeightField& surface) {
    if (!surface.base.is_curved()) return;
    const auto [low, high] = std::minmax_element(surface.heights.begin(), surface.heights.end());
    const double deepest = std::max(-static_cast<double>(*low), static_cast<double>(*high)),
                 pitch = std::max(surface.pitch_x, surface.pitch_y);
    for (const auto& [name, kappa] :
         {std::pair{"/base/kappa_1", surface.base.kappa_1}, {"/base/kappa_2", surface.base.kappa_2}}) {
        // Named again for clang 14, which captures no structured bindings.
        auto refuse = [name = name, kappa = kappa](double length, double most, const std::string& what) {
            throw Error(ErrorCode::invalid_input, name,
                        text_of(kappa) + " 1/m (radius " + text_of(1 / std::abs(kappa)) + " m)",
                        what + " of " + text_of(length) + " m allows at most " + text_of(most / length) +
                            " 1/m, either sign");
        };
        if (std::abs(kappa) * deepest > most_height)
            refuse(deepest, most_height, "a relief that leaves its mean by up to");
        if (std::abs(kappa) * pitch > most_cell) refuse(pitch, most_cell, "a pitch");
    }
}

std::vector<std::string> base_warnings(const HeightField& surface) {
    if (!surface.base.is_curved()) return {};
    const auto [low, high] = std::minmax_element(surface.heights.begin(), surface.heights.end());
    const double range = static_cast<double>(*high) - *low;
    const BaseCurvature& base = surface.base;
    std::vector<std::string> warnings;
    const double share = std::max(std::abs(base.kappa_1), std::abs(base.kappa_2)) * range;
    if (share > 0.1)
        warnings.push_back(
            "the relief is " + text_of(share) +
            " of the smallest radius of its base high: what bending does to light is known to third "
            "order in such shares, and on other bases than spheres to first order");
    // A horizontal ray at the lowest point of a hollow is in the layer for this share of a quarter turn and
    // more.
    const double hollow = -std::min({base.kappa_1, base.kappa_2, 0.0});
    if (hollow * range > 0.02)
        warnings.push_back("the base is a hollow of radius " + text_of(1 / hollow) + " m under a relief of " +
                           text_of(range) + " m: rays below " +
                           text_of(degrees(std::atan(std::sqrt(2 * hollow * range)))) +
                           " degrees need not leave it; they are followed until they do or hit");
    return warnings;
}

Vec3 displaced_position(const BaseCurvature& base, double x, double y, double height) {
    const double distance = std::hypot(x, y);
    if (distance == 0) return {0, 0, height};
    const double kappa = base.along(x, y), turn = kappa * distance, half = std::sin(turn / 2);
    const double sinc = turn == 0 ? 1 : std::sin(turn) / turn;
    const double out = (1 + kappa * height) * sinc;
    return {out * x, out * y, height * std::cos(turn) - (kappa == 0 ? 0 : 2 * half * half / kappa)};
}

DisplacedFacet displaced_facet(const HeightField& surface, int kind, int i, int j) {
    // Nodes in cells from the corner (i, j), counter-clockwise; the centroid of kind 0 is (2/3, 1/3).
    const int nodes[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{0, 0}, {1, 1}, {0, 1}}};
    const double middle_x = kind == 0 ? 2.0 / 3 : 1.0 / 3, middle_y = 1 - middle_x;
    // Along each principal direction as on a cylinder: right at every azimuth, a facet being small.
    const BaseCurvature& base = surface.base;
    const double c = std::cos(base.direction), s = std::sin(base.direction);
    Vec3 corner[3];
    for (int k = 0; k < 3; ++k) {
        const double x = (nodes[kind][k][0] - middle_x) * surface.pitch_x,
                     y = (nodes[kind][k][1] - middle_y) * surface.pitch_y,
                     height = surface.at(i + nodes[kind][k][0], j + nodes[kind][k][1]);
        const Vec3 p = displaced_position({base.kappa_1, 0, 0}, c * x + s * y, 0, height),
                   q = displaced_position({base.kappa_2, 0, 0}, c * y - s * x, 0, height);
        corner[k] = {c * p.x - s * q.x, s * p.x + c * q.x, p.z + q.z - height};
    }
    const Vec3 a{corner[1].x - corner[0].x, corner[1].y - corner[0].y, corner[1].z - corner[0].z},
        b{corner[2].x - corner[0].x, corner[2].y - corner[0].y, corner[2].z - corner[0].z},
        n{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    const double length = std::sqrt(dot(n, n));
    return {{n.x / length, n.y / length, n.z / length}, 0.5 * length / (surface.pitch_x * surface.pitch_y)};
}

}  // namespace gonio
