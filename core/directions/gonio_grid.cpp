#include "directions/gonio_grid.h"

#include <array>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace gonio {

std::vector<AnglesDeg> product_grid(const std::vector<double>& theta_deg,
                                    const std::vector<double>& phi_deg) {
    std::vector<AnglesDeg> grid;
    grid.reserve(theta_deg.size() * phi_deg.size());
    for (const double theta : theta_deg)
        for (const double phi : phi_deg) grid.push_back({theta, phi});
    return grid;
}

std::vector<AnglesDeg> equal_projected_hemisphere(int n) {
    if (n < 1) throw Error(ErrorCode::invalid_input, "hemisphere", std::to_string(n), "must be at least 1");
    std::vector<AnglesDeg> directions;
    directions.reserve(n);
    for (int k = 0; k < n; ++k)
        directions.push_back({degrees(std::asin(std::sqrt((k + 0.5) / n))),
                              360 * fractional_part(k * (std::numbers::phi - 1))});
    return directions;
}

std::vector<AnglesDeg> klems_full() {
    constexpr std::array<int, 9> azimuths{1, 8, 16, 20, 24, 24, 24, 16, 12};
    // Rings are 10 deg wide but for the cap (0-5) and the last (75-90); the direction is the middle of the
    // bounds in theta.
    constexpr std::array<double, 9> theta_deg{0, 10, 20, 30, 40, 50, 60, 70, 82.5};
    std::vector<AnglesDeg> directions;
    for (size_t ring = 0; ring < azimuths.size(); ++ring)
        for (int k = 0; k < azimuths[ring]; ++k)
            directions.push_back({theta_deg[ring], 360.0 * k / azimuths[ring]});
    return directions;
}

namespace {

void add_ring(double theta_deg, int n, double first_step, std::vector<AnglesDeg>& directions) {
    for (int k = 0; k < n; ++k) directions.push_back({theta_deg, 360 * (k + first_step) / n});
}

constexpr int bonn_rings[] = {6, 12, 18, 20, 24}, dome_rings_between[] = {6, 10, 14, 18, 22};

}  // namespace

std::vector<AnglesDeg> bonn_81() {
    std::vector<AnglesDeg> directions{{0, 0}};
    for (int ring = 0; ring < 5; ++ring) add_ring(15.0 * (ring + 1), bonn_rings[ring], 0, directions);
    return directions;
}

std::vector<AnglesDeg> bonn_151() {
    std::vector<AnglesDeg> directions{{0, 0}};
    for (int ring = 0; ring < 5; ++ring) {
        add_ring(15.0 * ring + 7.5, dome_rings_between[ring], 0.5, directions);
        add_ring(15.0 * (ring + 1), bonn_rings[ring], 0, directions);
    }
    return directions;
}

}  // namespace gonio
