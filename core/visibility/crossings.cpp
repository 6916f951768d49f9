#include "visibility/crossings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "visibility/curvature.h"

namespace gonio {
namespace {

constexpr double edge_margin = 1e-4;

// Crossings of one family of parallel grid lines, one after the other: the coordinate
// p(t) = p0 + rate t + bend t^2 passes integers.
class LineFamily {
  public:
    LineFamily(double p0, double rate, double bend) : p0_(p0), rate_(rate), bend_(bend) {
        const bool up = bend == 0 ? rate > 0 : rate > 0 || (rate == 0 && bend > 0);
        side_ = up ? 1 : -1;
        line_ = up ? std::floor(p0 + 1e-7) + 1 : std::ceil(p0 - 1e-7) - 1;
        if (bend != 0) {
            travel_ = bent_travel();
        } else if (std::abs(rate) < 1e-9) {
            first_ = travel_ = never;
        } else {
            first_ = travel_ = (line_ - p0) / rate;
            step_ = 1 / std::abs(rate);
        }
    }
    double travel() const { return travel_; }  // to the next crossing
    void advance() {
        if (bend_ == 0) {
            travel_ = first_ + ++n_ * step_;  // and not repeated addition: no error builds up
        } else {
            line_ += side_;
            travel_ = bent_travel();
        }
    }

  private:
    static constexpr double never = 1e300;
    double bent_travel() {
        double squared = rate_ * rate_ + 4 * bend_ * (line_ - p0_);
        if (squared < 0) {  // the path turns before this line and crosses the last one again
            side_ = -side_;
            line_ += side_;
            squared = std::max(0.0, rate_ * rate_ + 4 * bend_ * (line_ - p0_));
        }
        const double velocity = side_ * std::sqrt(squared);
        const double t =
            rate_ * side_ > 0 ? 2 * (line_ - p0_) / (rate_ + velocity) : (velocity - rate_) / (2 * bend_);
        return t > 0 ? t : never;
    }

    double p0_, rate_, bend_, line_, travel_ = never, first_ = never, step_ = 0;
    int side_, n_ = 0;
};

struct RawCrossing {
    double travel, weight;
    int x0, y0, x1, y1;        // the edge's nodes
    int cell_x, cell_y, kind;  // of the facet crossed before it
};

std::vector<RawCrossing> list_crossings(const RayPath& path, double max_travel) {
    std::vector<RawCrossing> list;
    LineFamily vertical(path.u, path.step_u, path.bend_u), horizontal(path.v, path.step_v, path.bend_v),
        diagonal(path.u - path.v, path.step_u - path.step_v, path.bend_u - path.bend_v);
    double previous = 0;
    for (;;) {
        const double travel = std::min({vertical.travel(), horizontal.travel(), diagonal.travel()});
        if (travel > max_travel) break;
        const auto [x, y] = path.at(travel);
        const auto [mid_x, mid_y] = path.at(0.5 * (travel + previous));
        RawCrossing c;
        c.travel = travel;
        c.cell_x = static_cast<int>(std::floor(mid_x));
        c.cell_y = static_cast<int>(std::floor(mid_y));
        c.kind = (mid_x - c.cell_x) >= (mid_y - c.cell_y) ? 0 : 1;
        if (travel == vertical.travel()) {
            c.x0 = c.x1 = static_cast<int>(std::lround(x));
            c.y0 = static_cast<int>(std::floor(y + 1e-9));
            c.y1 = c.y0 + 1;
            c.weight = y - c.y0;
            vertical.advance();
        } else if (travel == horizontal.travel()) {
            c.y0 = c.y1 = static_cast<int>(std::lround(y));
            c.x0 = static_cast<int>(std::floor(x + 1e-9));
            c.x1 = c.x0 + 1;
            c.weight = x - c.x0;
            horizontal.advance();
        } else {
            c.x0 = static_cast<int>(std::floor(x + 1e-9));
            c.y0 = c.x0 - static_cast<int>(std::lround(x - y));
            c.x1 = c.x0 + 1;
            c.y1 = c.y0 + 1;
            c.weight = x - c.x0;
            diagonal.advance();
        }
        c.weight = std::clamp(c.weight, 0.0, 1.0);
        list.push_back(c);
        previous = travel;
    }
    return list;
}

// How the base bends the rays of a bundle; lengths in units of pitch_x.
struct Bend {
    double kappa;   // normal curvature
    double length;  // base distance of one cell of travel
    double slope;   // of the ray at its start

    double angle(double travel) const { return kappa * length * travel; }
    double scale(double travel) const { return std::cos(angle(travel)) - slope * std::sin(angle(travel)); }
    double rise(double travel) const {
        const double half = std::sin(angle(travel) / 2);
        return (2 * half * half + slope * std::sin(angle(travel))) / kappa;
    }
    // Smallest travel after which the ray that starts at height `from` stands at height `to`, if any.
    // With t = tan(gamma / 2) and q = (R + from) / (R + to): (1 + q) t^2 + 2 m t - (1 - q) = 0.
    std::optional<double> travel_to(double from, double to) const {
        const double q = (1 + kappa * from) / (1 + kappa * to), rest = kappa * (to - from) / (1 + kappa * to);
        const double squared = slope * slope + rest * (1 + q);
        if (squared < 0) return {};
        const double root = std::sqrt(squared), sign = kappa > 0 ? 1 : -1;
        std::optional<double> least;
        auto offer = [&](double t) {
            const double travel = 2 * std::atan(t) / (kappa * length);
            if (sign * t > 0 && (!least || travel < *least)) least = travel;
        };
        // Each root in the form that does not cancel.
        const double far = -(slope + std::copysign(root, slope));
        offer(far / (1 + q));
        if (far != 0) offer(-rest / far);
        return least;
    }
};

// Travel after which every ray of the bundle has left or hit.
double resolved_travel(const Bend& bend, const MarchGrid& grid, double max_travel) {
    const double quarter_turn = pi / 2 / (std::abs(bend.kappa) * bend.length);
    double travel = std::min(max_travel, quarter_turn);
    if (const auto left = bend.travel_to(grid.lowest, grid.highest)) travel = std::min(travel, *left + 2);
    if (const auto hit = bend.travel_to(grid.highest, grid.lowest)) travel = std::min(travel, *hit + 2);
    return travel;
}

// Greedy runs of crossings that fit a window. The first crossings are tested singly: most rays that hit do so
// there.
std::vector<CrossingGroup> group_crossings(const std::vector<RawCrossing>& list,
                                           const std::vector<Crossing>& crossings, double rise,
                                           const std::optional<Bend>& bend, int nx, int ny) {
    constexpr int singly = 16;
    std::vector<CrossingGroup> groups;
    const int n = static_cast<int>(list.size());
    int k = std::min(n, singly);
    groups.push_back({k, -1, 0, 0, 0});
    while (k < n) {
        const int window = k < 3 * singly ? 0 : 1, size = window_size[window];
        int x_min = list[k].x0, x_max = list[k].x1, y_min = list[k].y0, y_max = list[k].y1, end = k;
        for (; end < n; ++end) {
            const RawCrossing& c = list[end];
            const int x_lo = std::min(x_min, c.x0), x_hi = std::max(x_max, c.x1);
            const int y_lo = std::min(y_min, c.y0), y_hi = std::max(y_max, c.y1);
            if (x_hi - x_lo > size || y_hi - y_lo > size) break;
            x_min = x_lo, x_max = x_hi, y_min = y_lo, y_max = y_hi;
        }
        CrossingGroup group{end, window, wrap_index(x_min, nx), wrap_index(y_min, ny),
                            rise > 0 ? crossings[k].rise : crossings[end - 1].rise};
        if (bend)
            for (int c = k; c < end; ++c) {
                const float scale = crossings[c].weight0 + crossings[c].weight1;
                if (c == k || (bend->kappa > 0 ? scale > group.scale : scale < group.scale)) {
                    group.scale = scale;
                    group.lowest_rise = crossings[c].rise;
                }
            }
        groups.push_back(group);
        k = end;
    }
    return groups;
}

}  // namespace

FacetPoint facet_point(int kind, double a, double b, int refinement, int part) {
    double u = std::max(a, b), v = std::min(a, b);  // the square folded onto the triangle u >= v
    if (refinement > 1) {
        // Column p of the subdivision holds 2 p + 1 parts, so it starts at part p^2: for each q <= p the
        // triangle below the diagonal of sub-cell (p, q), and for q < p the one above it.
        const int p = static_cast<int>(std::sqrt(part + 0.5)), q = (part - p * p) / 2;
        if ((part - p * p) % 2 != 0) std::swap(u, v);
        u = (p + u) / refinement;
        v = (q + v) / refinement;
    }
    u = std::clamp(u, 2 * edge_margin, 1 - edge_margin);
    v = std::clamp(v, edge_margin, u - edge_margin);
    return kind == 0 ? FacetPoint{0, u, v} : FacetPoint{1, 1 - u, 1 - v};
}

int facet_part(int kind, double u, double v, int refinement) {
    if (kind == 1) u = 1 - u, v = 1 - v;
    const double su = std::clamp(u, 0.0, 1.0) * refinement, sv = std::clamp(v, 0.0, 1.0) * refinement;
    const int p = std::min(static_cast<int>(su), refinement - 1), q = std::min(static_cast<int>(sv), p);
    const bool upper = p > q && (sv - q) > (su - p);
    return p * p + 2 * q + (upper ? 1 : 0);
}

namespace {

// What carries a path sideways over the base, in cells, per pitch_x^2 of (travel times height): a point of
// height h is h K d further along d than its foot, of which the part across d is what this takes back.
std::array<double, 2> sideways_drift(const MarchGrid& grid, double x, double y) {
    const double length = std::hypot(x, y), dx = x / length, dy = y / length;
    const BaseCurvature::Tensor k = grid.base.tensor();
    const double across = -grid.pitch_x * (dx * (k.xy * dx + k.yy * dy) - dy * (k.xx * dx + k.xy * dy));
    return {-dy * across, dx * across * grid.pitch_x / grid.pitch_y};
}

RayBundle make_bundle(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                      double max_travel, bool bends, const StartHeights& heights) {
    RayBundle bundle;
    bundle.direction = to_march_direction(grid, direction);
    bundle.start = start;
    bundle.transposed =
        grid.has_transposed() && std::abs(bundle.direction.step_y) > std::abs(bundle.direction.step_x);
    if (bundle.transposed) {
        std::swap(bundle.direction.step_x, bundle.direction.step_y);
        bundle.start = {1 - start.kind, start.v, start.u};
    }
    const MarchPlane& plane = bundle.transposed ? grid.transposed : grid.rows;
    const auto [kind, u, v] = bundle.start;
    const auto [dx, dy, rise] = bundle.direction;
    const double weights[2][3] = {{1 - u, u - v, v}, {1 - v, v - u, u}};
    for (int k = 0; k < 3; ++k) bundle.start_weight[k] = static_cast<float>(weights[kind][k]);

    bundle.path = {u, v, dx, dy};
    std::optional<Bend> bend;
    if (bends) {
        const double x = bundle.transposed ? dy : dx,
                     y = (bundle.transposed ? dx : dy) * grid.pitch_y / grid.pitch_x,
                     kappa = grid.pitch_x * grid.base.along(x, y), length = std::hypot(x, y);
        if (kappa != 0) bend = Bend{kappa, length, rise / length};
        if (!grid.base.is_round()) {
            auto [drift_u, drift_v] = sideways_drift(grid, x, y);
            if (bundle.transposed) std::swap(drift_u, drift_v);
            bundle.path.step_u += drift_u * length * heights.typical;
            bundle.path.step_v += drift_v * length * heights.typical;
            // A ray so steep that it passes the layer within a cell hardly drifts on its way.
            const double range = static_cast<double>(grid.highest) - grid.lowest,
                         climb = std::clamp(rise, -range, range);
            bundle.path.bend_u = drift_u * length * climb;
            bundle.path.bend_v = drift_v * length * climb;
        }
        bundle.heights = heights;
    }
    double travel = max_travel;
    if (bend) {
        travel = resolved_travel(*bend, grid, max_travel);
        bundle.truncated = travel == max_travel || std::abs(bend->angle(travel)) >= pi / 2;
    } else {
        // A rising ray is free once above the highest point, a falling one has hit once below the lowest.
        const double range = static_cast<double>(grid.highest) - grid.lowest;
        if (std::abs(rise) > 0) travel = std::min(max_travel, range / std::abs(rise) + 2);
        bundle.truncated = travel == max_travel;
        // One row: after one period everything repeats below the risen ray.
        if (plane.ny == 1 && rise >= 0)
            travel = std::min(travel, plane.nx / std::max(std::abs(dx), 1e-6) + 2);
    }
    std::vector<RawCrossing> list = list_crossings(bundle.path, travel);
    if (bend) {
        // A steep ray leaves long before it is as steep as the base. One that falls into a hollow has hit by
        // then, which the first such crossing tells (its rise is -1 / |kappa|).
        auto end = std::find_if(list.begin(), list.end(),
                                [&](const RawCrossing& c) { return !(bend->scale(c.travel) > 0); });
        if (bend->kappa < 0 && end != list.end()) ++end;
        list.erase(end, list.end());
    }

    bundle.crossings.reserve(list.size());
    bundle.facets.reserve(list.size());
    for (const RawCrossing& c : list) {
        const double scale = bend ? std::max(0.0, bend->scale(c.travel)) : 1.0;
        bundle.crossings.push_back(
            {static_cast<float>(scale * (1 - c.weight)), static_cast<float>(scale * c.weight),
             static_cast<float>(bend ? bend->rise(c.travel) : rise * c.travel), wrap_index(c.x0, plane.nx),
             wrap_index(c.y0, plane.ny), (c.y1 - c.y0) * plane.stride + (c.x1 - c.x0)});
        bundle.facets.push_back({c.cell_x, c.cell_y, c.kind, static_cast<float>(c.travel)});
    }
    if (bend) {
        bundle.bent = true;
        bundle.kappa = static_cast<float>(bend->kappa);
        float lowest = std::numeric_limits<float>::infinity();
        for (const RawCrossing& c : list) {
            lowest = std::min(
                lowest, static_cast<float>(bend->scale(c.travel) * grid.highest - bend->rise(c.travel)));
            bundle.escape.push_back(lowest);
        }
    }
    bundle.groups = group_crossings(list, bundle.crossings, rise, bend, plane.nx, plane.ny);
    return bundle;
}

}  // namespace

std::vector<StartHeights> start_heights(const MarchGrid& grid, const Vec3& direction) {
    constexpr double most_turn = 0.01;  // of a path against the typical one, radians
    const MarchDirection step = to_march_direction(grid, direction);
    if (!grid.base.bends_rays() || grid.base.is_round()) return {StartHeights{}};
    const auto [drift_x, drift_y] =
        sideways_drift(grid, step.step_x, step.step_y * grid.pitch_y / grid.pitch_x);
    const double range = static_cast<double>(grid.highest) - grid.lowest,
                 drift = std::hypot(drift_x, drift_y * grid.pitch_y / grid.pitch_x);
    const int n = std::clamp(static_cast<int>(std::ceil(drift * range / (2 * most_turn))), 1, 64);
    if (n == 1) return {StartHeights{}};
    std::vector<StartHeights> layers(n);
    for (int k = 0; k < n; ++k) {
        const auto bound = [&](int edge) { return static_cast<float>(grid.lowest + range * edge / n); };
        layers[k].typical = grid.lowest + range * (k + 0.5) / n;
        if (k > 0) layers[k].from = bound(k);
        if (k + 1 < n) layers[k].below = bound(k + 1);
    }
    return layers;
}

RayBundle make_ray_bundle(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                          double max_travel, const StartHeights& heights) {
    return make_bundle(grid, direction, start, max_travel, grid.base.bends_rays(), heights);
}

RayBundle make_level_bundle(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start,
                            double max_travel) {
    return make_bundle(grid, direction, start, max_travel, false, {});
}

ViewEntry view_entry(const MarchGrid& grid, const Vec3& view, double height) {
    const double climb = grid.highest - height, horizontal = std::hypot(view.x, view.y);
    if (!grid.base.bends_rays() || climb <= 0 || horizontal < 1e-12)
        return {climb * view.x / view.z, climb * view.y / view.z * (grid.pitch_x / grid.pitch_y), view};
    const double kappa = grid.pitch_x * grid.base.along(view.x, view.y), slope = view.z / horizontal;
    double distance = climb / slope;
    if (kappa != 0) distance = Bend{kappa, 1, slope}.travel_to(height, grid.highest).value_or(distance);
    const auto [drift_x, drift_y] = sideways_drift(grid, view.x, view.y);
    const double sideways = distance * (height + slope * distance),
                 x = distance * view.x / horizontal + sideways * drift_x,
                 y = distance * view.y / horizontal * (grid.pitch_x / grid.pitch_y) + sideways * drift_y;
    return {x, y, turned_direction(view, grid.base, x * grid.pitch_x, y * grid.pitch_y)};
}

RayBundle make_view_bundle(const MarchGrid& grid, const Vec3& view, double u, double v, double max_travel) {
    StartHeights top;
    top.typical = grid.highest;
    RayBundle bundle =
        make_ray_bundle(grid, {-view.x, -view.y, -view.z}, {u >= v ? 0 : 1, u, v}, max_travel, top);
    bundle.from_above = true;
    bundle.start_height = grid.highest;
    return bundle;
}

}  // namespace gonio
