// Polar lobes in the plane of incidence: the light comes from the left, the mirror direction is on the right,
// the distance from the centre is f.
#include <algorithm>

#include "base/numeric.h"
#include "base/text.h"
#include "clients/plot/axis.h"
#include "clients/plot/palette.h"
#include "clients/plot/panels.h"
#include "clients/plot/table_view.h"

namespace gonio {
namespace {

struct Lobe {
    std::string name;
    AnglesDeg wi;
    Colour colour;
    bool is_dashed = false;
    std::vector<LobeSample> samples;
};

// Up to n indices spread evenly over the list.
std::vector<size_t> spread(size_t size, size_t n) {
    std::vector<size_t> chosen;
    n = std::min(n, size);
    for (size_t k = 0; k < n; ++k) chosen.push_back(n == 1 ? 0 : k * (size - 1) / (n - 1));
    return chosen;
}

std::string angles_text(const AnglesDeg& a) {
    return "\u03b8i " + number_text(a.theta_deg, 3) + "\u00b0" +
           (a.phi_deg != 0 ? ", \u03c6i " + number_text(a.phi_deg, 3) + "\u00b0" : "");
}

// One channel: a few incident directions. Several channels: a few channels of one incident direction.
std::vector<Lobe> choose_lobes(const Table& table, int map_incident) {
    std::vector<Lobe> lobes;
    if (table.channels.size() > 1) {
        const AnglesDeg wi = table.incident[map_incident];
        for (const size_t c : spread(table.channels.size(), 4)) {
            Lobe lobe{table.channels[c] + ", " + angles_text(wi), wi, channel_colour(table.channels, c),
                      lobes.size() % 2 == 1, in_plane(samples_of(table, map_incident, c), wi)};
            if (lobe.samples.size() >= 2) lobes.push_back(std::move(lobe));
        }
        return lobes;
    }
    bool has_pole = false;
    std::vector<int> candidates;  // of one azimuth, so that the diagram is one plane
    for (int i = 0; i < static_cast<int>(table.incident.size()) && table.incident.size() <= 4096; ++i) {
        const AnglesDeg& wi = table.incident[i];
        const bool is_pole = wi.theta_deg == 0 && !has_pole;  // grids hold normal incidence once an azimuth
        if (!is_pole && (wi.theta_deg == 0 || wi.phi_deg != table.incident[map_incident].phi_deg)) continue;
        has_pole |= is_pole;
        if (in_plane(samples_of(table, i, 0), wi).size() >= 2) candidates.push_back(i);
    }
    std::sort(candidates.begin(), candidates.end(),
              [&](int a, int b) { return table.incident[a].theta_deg < table.incident[b].theta_deg; });
    for (const size_t k : spread(candidates.size(), 4)) {
        const AnglesDeg& wi = table.incident[candidates[k]];
        lobes.push_back({angles_text(wi), wi, category_colour(lobes.size()), lobes.size() % 2 == 1,
                         in_plane(samples_of(table, candidates[k], 0), wi)});
    }
    return lobes;
}

}  // namespace

void draw_lobes(Canvas& canvas, const Table& table, int map_incident, Point corner, double width) {
    const std::vector<Lobe> lobes = choose_lobes(table, map_incident);
    const double radius = 0.5 * width - 34;
    const Point centre{corner.x + 0.5 * width, corner.y + 54 + radius};
    canvas.text(corner, "Plane of incidence", 12.5, ink, Align::left, true);

    double highest = 0;
    for (const Lobe& lobe : lobes)
        for (const LobeSample& s : lobe.samples) highest = std::max(highest, s.f + s.error);
    const Scale scale = enclosing_scale(0, highest > 0 ? highest : 1, false, 4);
    const double reach =
        0.88 * radius;  // of the highest value; beyond it there is room for the arrows of the lights
    const std::vector<double> rings = ticks(scale, 4);
    auto at = [&](double theta_deg, double f) {
        const double r = reach * std::clamp(f / scale.high, 0.0, 1.0), theta = radians(theta_deg);
        return Point{centre.x + r * std::sin(theta), centre.y - r * std::cos(theta)};
    };

    for (const double value : rings)
        if (value > 0) canvas.arc(centre, reach * value / scale.high, 0, pi, pale, 0.8);
    for (int theta_deg = -90; theta_deg <= 90; theta_deg += 30) {
        canvas.line({centre, at(theta_deg, scale.high)}, pale, 0.8);
        const Point label{centre.x + (radius + 14) * std::sin(radians(theta_deg)),
                          centre.y - (radius + 12) * std::cos(radians(theta_deg))};
        canvas.text(label, std::to_string(std::abs(theta_deg)) + "\u00b0", 10.5, grey, Align::centre);
    }
    canvas.line({{centre.x - radius, centre.y}, {centre.x + radius, centre.y}}, ink, 1);
    for (const double value : rings) {
        if (value == 0) continue;
        const Point p{centre.x + reach * value / scale.high, centre.y + 11};
        canvas.text(p, tick_label(value), 10, ink, Align::centre);
    }
    canvas.text({centre.x, centre.y + 12}, "0", 10, ink, Align::centre);
    canvas.text({centre.x + 0.5 * radius, centre.y + 27}, "f  [1/sr]", 11, ink, Align::centre);
    canvas.text({centre.x - 0.5 * radius, centre.y + 12}, "\u2190 light side", 10, grey, Align::centre);

    if (lobes.empty()) {
        canvas.text({centre.x, centre.y - 0.45 * radius}, "The table holds too few outgoing directions", 12,
                    ink, Align::centre);
        canvas.text({centre.x, centre.y - 0.45 * radius + 17}, "in the plane of incidence to draw a lobe.",
                    12, ink, Align::centre);
        return;
    }
    for (const Lobe& lobe : lobes) {
        std::vector<Point> band, curve;
        for (const LobeSample& s : lobe.samples) band.push_back(at(s.theta_deg, s.f + s.error));
        for (auto s = lobe.samples.rbegin(); s != lobe.samples.rend(); ++s)
            band.push_back(at(s->theta_deg, s->f - s->error));
        canvas.polygon(band, lobe.colour, 0.28);
        for (const LobeSample& s : lobe.samples) curve.push_back(at(s.theta_deg, s.f));
        canvas.line(curve, lobe.colour, 1.8, lobe.is_dashed);
        if (curve.size() <= 40)
            for (const Point& p : curve) canvas.disk(p, 2, lobe.colour);
    }
    for (const Lobe& lobe : lobes) {  // the light, outside the rim, on its own side
        const double theta = radians(lobe.wi.theta_deg);
        auto on_ray = [&](double r) {
            return Point{centre.x - r * std::sin(theta), centre.y - r * std::cos(theta)};
        };
        canvas.arrow(on_ray(radius + 2), on_ray(reach + 2), table.channels.size() > 1 ? ink : lobe.colour, 2);
    }
    double y = centre.y + 48;
    for (size_t k = 0; k < lobes.size(); ++k) {
        const double x = corner.x + 16 + (k % 2 == 1 ? 0.5 * width : 0);
        canvas.line({{x, y}, {x + 26, y}}, lobes[k].colour, 2, lobes[k].is_dashed);
        canvas.text({x + 33, y}, lobes[k].name, 11, ink);
        if (k % 2 == 1) y += 17;
    }
    if (lobes.size() % 2 == 1) y += 17;
    canvas.text({corner.x + 16, y}, "band: \u00b1 (standard error and bias); arrow: light", 9.5, grey);
}

}  // namespace gonio
