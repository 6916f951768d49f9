#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "clients/plot/plot.h"
#include "clients/plot/table_view.h"
#include "fitting/sh_projection.h"

namespace gonio {
namespace {

// The incident directions nearest to 15, 45 and 75 degrees.
std::vector<int> drawn_lights(const Table& table) {
    std::vector<int> lights;
    for (const double wanted : {15.0, 45.0, 75.0}) {
        const auto distance = [&](const AnglesDeg& a) { return std::abs(a.theta_deg - wanted); };
        const auto nearest = std::min_element(
            table.incident.begin(), table.incident.end(),
            [&](const AnglesDeg& a, const AnglesDeg& b) { return distance(a) < distance(b); });
        const int light = static_cast<int>(nearest - table.incident.begin());
        if (std::count(lights.begin(), lights.end(), light) == 0) lights.push_back(light);
    }
    return lights;
}

}  // namespace

void plot_projection(const Table& table, const HarmonicProjection& projection, const std::string& path) {
    const size_t channel = table.channels.size() / 2;
    std::vector<PlotSeries> series;
    for (const int light : drawn_lights(table)) {
        const AnglesDeg wi = table.incident[light];
        const int category = static_cast<int>(series.size());
        const std::string name = number_text(wi.theta_deg, 3) + " deg, ";
        PlotSeries measured{name + "measured", {}, {}, false, category};
        for (const LobeSample& sample : in_plane(samples_of(table, light, channel), wi)) {
            measured.x.push_back(sample.theta_deg);
            measured.y.push_back(sample.f);
        }
        if (!measured.x.empty()) series.push_back(measured);
        PlotSeries projected{name + "reconstructed", {}, {}, true, category};
        std::vector<AnglesDeg> views;
        for (int theta = -85; theta <= 85; ++theta) {
            projected.x.push_back(theta);
            views.push_back({std::abs(static_cast<double>(theta)), wi.phi_deg + (theta < 0 ? 0 : 180)});
        }
        const Table curve = reconstruct(projection, {wi}, views);
        for (size_t o = 0; o < views.size(); ++o) projected.y.push_back(curve.f[curve.index(channel, 0, o)]);
        series.push_back(projected);
    }
    plot_lines(series, path,
               {"Lobes in the plane of incidence", "theta_o in degrees, negative on the side of the light",
                "f in 1/sr", "Channel " + table.channels[channel], false, false});
}

}  // namespace gonio
