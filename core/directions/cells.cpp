#include "directions/cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"

namespace gonio {
namespace {

double square_sine(double theta_deg) {
    return std::pow(std::sin(radians(theta_deg)), 2);
}

// One ring of n sectors, the first of which begins at phi_start_deg.
void add_ring(std::vector<ReceiverCell>& cells, double theta_min_deg, double theta_max_deg, int n,
              double phi_start_deg) {
    for (int k = 0; k < n; ++k)
        cells.push_back({theta_min_deg, theta_max_deg, phi_start_deg + 360.0 * k / n,
                         phi_start_deg + 360.0 * (k + 1) / n});
}

}  // namespace

AnglesDeg centre(const ReceiverCell& cell) {
    const double theta = 0.5 * (cell.theta_min_deg + cell.theta_max_deg);
    if (cell.theta_min_deg == 0 && cell.phi_max_deg - cell.phi_min_deg == 360) return {0, 0};
    return {theta, 0.5 * (cell.phi_min_deg + cell.phi_max_deg)};
}

std::vector<AnglesDeg> centres(std::span<const ReceiverCell> cells) {
    std::vector<AnglesDeg> list;
    list.reserve(cells.size());
    for (const ReceiverCell& cell : cells) list.push_back(centre(cell));
    return list;
}

double solid_angle(const ReceiverCell& cell) {
    // cos a - cos b, without cancellation near the pole.
    const double a = radians(cell.theta_min_deg), b = radians(cell.theta_max_deg);
    return radians(cell.phi_max_deg - cell.phi_min_deg) * 2 * std::sin(0.5 * (a + b)) *
           std::sin(0.5 * (b - a));
}

double projected_solid_angle(const ReceiverCell& cell) {
    const double a = radians(cell.theta_min_deg), b = radians(cell.theta_max_deg);
    return radians(cell.phi_max_deg - cell.phi_min_deg) * 0.5 * std::sin(a + b) * std::sin(b - a);
}

Vec3 direction_in(const ReceiverCell& cell, double u, double v) {
    const double low = square_sine(cell.theta_min_deg), high = square_sine(cell.theta_max_deg);
    const double square = low + u * (high - low), sine = std::sqrt(square);
    const double phi = radians(cell.phi_min_deg + v * (cell.phi_max_deg - cell.phi_min_deg));
    return {sine * std::cos(phi), sine * std::sin(phi), std::sqrt(std::max(1 - square, 1e-12))};
}

std::vector<ReceiverCell> klems_full_cells() {
    constexpr std::array<int, 9> azimuths{1, 8, 16, 20, 24, 24, 24, 16, 12};
    constexpr std::array<double, 10> bounds_deg{0, 5, 15, 25, 35, 45, 55, 65, 75, 90};
    std::vector<ReceiverCell> cells;
    for (size_t ring = 0; ring < azimuths.size(); ++ring)
        add_ring(cells, bounds_deg[ring], bounds_deg[ring + 1], azimuths[ring], -180.0 / azimuths[ring]);
    return cells;
}

std::vector<ReceiverCell> equal_cells(int n) {
    if (n < 1) throw Error(ErrorCode::invalid_input, "cells", std::to_string(n), "must be at least 1");
    const int n_rings = std::max(1, static_cast<int>(std::lround(std::sqrt(n / pi))));
    std::vector<ReceiverCell> cells;
    double theta_min_deg = 0;
    for (int ring = 0, inside = 0; ring < n_rings; ++ring) {
        const double radius = static_cast<double>(ring + 1) / n_rings;
        const int outer = static_cast<int>(std::lround(n * radius * radius));
        const double theta_max_deg =
            ring + 1 == n_rings ? 90 : degrees(std::asin(std::sqrt(static_cast<double>(outer) / n)));
        add_ring(cells, theta_min_deg, theta_max_deg, outer - inside, 0);
        inside = outer;
        theta_min_deg = theta_max_deg;
    }
    return cells;
}

CellLocator::CellLocator(std::span<const ReceiverCell> cells) {
    for (size_t first = 0; first < cells.size();) {
        size_t end = first;
        while (end < cells.size() && cells[end].theta_min_deg == cells[first].theta_min_deg) ++end;
        Ring ring;
        ring.square_max = square_sine(cells[first].theta_max_deg);
        ring.first = static_cast<int>(first);
        ring.n = static_cast<int>(end - first);
        // Bound k of the ring, sorted by where it lies on the circle: behind it comes sector k.
        std::vector<std::pair<double, int>> bounds;
        for (int k = 0; k < ring.n; ++k) {
            const double phi = radians(cells[first + k].phi_min_deg);
            double angle = pseudo_angle(std::cos(phi), std::sin(phi));
            if (std::abs(std::sin(phi)) < 1e-15 && std::cos(phi) > 0) angle = 0;
            bounds.emplace_back(angle, k);
        }
        std::sort(bounds.begin(), bounds.end());
        ring.shift = bounds[0].second + ring.n - 1;
        for (const auto& [angle, sector] : bounds) ring.bounds.push_back(angle);
        for (int step = 0; step < 4 * sector_steps; ++step)
            ring.guide.push_back(static_cast<int>(std::upper_bound(ring.bounds.begin(), ring.bounds.end(),
                                                                   static_cast<double>(step) / sector_steps) -
                                                  ring.bounds.begin()));
        rings_.push_back(std::move(ring));
        first = end;
    }
    for (int step = 0, r = 0; step <= ring_steps; ++step) {
        while (r + 1 < static_cast<int>(rings_.size()) &&
               static_cast<double>(step) / ring_steps >= rings_[r].square_max)
            ++r;
        ring_guide_.push_back(r);
    }
}

}  // namespace gonio
