// The outgoing hemisphere seen from above as a projected disk (equal areas are equal projected solid angles),
// f in colours.
#include <algorithm>
#include <limits>

#include "base/numeric.h"
#include "base/text.h"
#include "clients/plot/axis.h"
#include "clients/plot/palette.h"
#include "clients/plot/panels.h"
#include "clients/plot/table_view.h"

namespace gonio {
namespace {

constexpr double not_measured = std::numeric_limits<double>::quiet_NaN();

// A product grid of samples: theta ascending, phi ascending in [0, 360).
struct SampleGrid {
    std::vector<double> theta_deg, phi_deg;
    std::vector<double> f;  // [theta][phi]

    // Bilinear between existing samples. Gaps of more than 60 degrees in azimuth, and what lies beyond the
    // outermost ring, stay open.
    double value(double theta, double phi) const {
        if (theta > theta_deg.back() + 1e-9) return not_measured;
        const size_t n_phi = phi_deg.size();
        const size_t above = std::upper_bound(phi_deg.begin(), phi_deg.end(), phi) - phi_deg.begin();
        const size_t p1 = above % n_phi, p0 = (above + n_phi - 1) % n_phi;
        const double gap = n_phi == 1 ? 360 : phi_deg[p1] - phi_deg[p0] + (p1 <= p0 ? 360 : 0);
        if (gap > 60) return not_measured;
        const double from = phi - phi_deg[p0] + (phi < phi_deg[p0] ? 360 : 0), w = from / gap;
        auto ring = [&](size_t t) { return (1 - w) * f[t * n_phi + p0] + w * f[t * n_phi + p1]; };
        const size_t t1 = std::lower_bound(theta_deg.begin(), theta_deg.end(), theta) - theta_deg.begin();
        if (t1 >= theta_deg.size()) return ring(theta_deg.size() - 1);
        if (t1 == 0) {  // inside the innermost ring: its mean at the pole
            double mean = 0;
            for (size_t p = 0; p < n_phi; ++p) mean += f[p] / static_cast<double>(n_phi);
            const double v = theta_deg[0] > 0 ? theta / theta_deg[0] : 1;
            return (1 - v) * mean + v * ring(0);
        }
        const double v = (theta - theta_deg[t1 - 1]) / (theta_deg[t1] - theta_deg[t1 - 1]);
        return (1 - v) * ring(t1 - 1) + v * ring(t1);
    }
};

// Empty if the samples are no such grid.
SampleGrid as_grid(const std::vector<OutgoingSample>& samples) {
    SampleGrid grid;
    auto azimuth = [](const OutgoingSample& s) { return 360 * fractional_part(s.wo.phi_deg / 360); };
    for (const OutgoingSample& s : samples) {
        grid.theta_deg.push_back(s.wo.theta_deg);
        grid.phi_deg.push_back(azimuth(s));
    }
    for (std::vector<double>* axis : {&grid.theta_deg, &grid.phi_deg}) {
        std::sort(axis->begin(), axis->end());
        axis->erase(std::unique(axis->begin(), axis->end()), axis->end());
    }
    if (grid.phi_deg.size() < 6 || grid.theta_deg.size() < 2 ||
        grid.theta_deg.size() * grid.phi_deg.size() > samples.size())
        return {};
    grid.f.assign(grid.theta_deg.size() * grid.phi_deg.size(), not_measured);
    for (const OutgoingSample& s : samples) {
        const size_t t = std::lower_bound(grid.theta_deg.begin(), grid.theta_deg.end(), s.wo.theta_deg) -
                         grid.theta_deg.begin();
        const size_t p =
            std::lower_bound(grid.phi_deg.begin(), grid.phi_deg.end(), azimuth(s)) - grid.phi_deg.begin();
        grid.f[t * grid.phi_deg.size() + p] = s.f;
    }
    return std::any_of(grid.f.begin(), grid.f.end(), [](double f) { return std::isnan(f); }) ? SampleGrid{}
                                                                                             : grid;
}

// Scattered samples: the plane through the neighbours by weighted least squares (inverse distances alone
// would draw a terrace around each sample). Nothing is drawn further from a sample than 1.5 times their mean
// spacing.
double scattered_value(const std::vector<OutgoingSample>& samples, const std::vector<Point>& places,
                       Point p) {
    const double spacing2 = 1 / static_cast<double>(samples.size()), reach2 = 14 * spacing2;
    double nearest = 10, s0 = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, f0 = 0, fx = 0, fy = 0;
    for (size_t k = 0; k < samples.size(); ++k) {
        const double dx = places[k].x - p.x, dy = places[k].y - p.y, r2 = dx * dx + dy * dy;
        nearest = std::min(nearest, r2);
        if (r2 > reach2) continue;
        const double fade = 1 - r2 / reach2, w = fade * fade / (r2 + 0.3 * spacing2);
        s0 += w, sx += w * dx, sy += w * dy, sxx += w * dx * dx, sxy += w * dx * dy, syy += w * dy * dy;
        f0 += w * samples[k].f, fx += w * dx * samples[k].f, fy += w * dy * samples[k].f;
    }
    if (nearest > 6 * spacing2) return not_measured;
    // Normal equations at p; a little ridge keeps one-sided neighbourhoods at the rim from extrapolating
    // wildly.
    sxx += 0.05 * s0 * spacing2, syy += 0.05 * s0 * spacing2;
    const double cxx = syy * s0 - sy * sy, cxy = sx * sy - sxy * s0, c0 = sxy * sy - syy * sx;
    const double det = sxx * cxx + sxy * cxy + sx * c0;
    const double c01 = sx * sxy - sxx * sy, c00 = sxx * syy - sxy * sxy;
    return det > 0 ? (c0 * fx + c01 * fy + c00 * f0) / det : f0 / s0;
}

Scale colour_scale(const std::vector<OutgoingSample>& samples, bool log_scale) {
    double low = samples[0].f, high = low, lowest_positive = 0;
    for (const OutgoingSample& s : samples) {
        low = std::min(low, s.f), high = std::max(high, s.f);
        if (s.f > 0 && (lowest_positive == 0 || s.f < lowest_positive)) lowest_positive = s.f;
    }
    if (log_scale && lowest_positive > 0) {
        low = std::max(lowest_positive, 1e-6 * high);
        return high > 1.05 * low ? Scale{low, high, true} : Scale{low / 1.05, high * 1.05, true};
    }
    // A constant must look constant: a range below 1 % of the value is noise.
    if (high - low < 0.01 * high || high <= 0) {
        const double middle = 0.5 * (low + high), pad = middle != 0 ? 0.05 * std::abs(middle) : 1;
        return {middle - pad, middle + pad, false};
    }
    return {low, high, false};
}

}  // namespace

void draw_map(Canvas& canvas, const Table& table, int incident, size_t channel, bool log_scale, Point corner,
              double width) {
    const AnglesDeg wi = table.incident[incident];
    const std::vector<OutgoingSample> samples = samples_of(table, incident, channel);
    const std::string of_channel = table.channels.size() > 1 ? " (" + table.channels[channel] + ")" : "";
    const std::string title = "Outgoing hemisphere" + of_channel + ", light at \u03b8i " +
                              number_text(wi.theta_deg, 3) + "\u00b0, \u03c6i " + number_text(wi.phi_deg, 3) +
                              "\u00b0";
    canvas.text(corner, title, 12.5, ink, Align::left, true);

    const double radius = 0.5 * (width - 110);
    const Point centre{corner.x + 22 + radius, corner.y + 36 + radius};
    auto at = [&](double theta_deg, double phi_deg) {
        const double r = radius * std::sin(radians(theta_deg)), phi = radians(phi_deg);
        return Point{centre.x + r * std::cos(phi), centre.y - r * std::sin(phi)};
    };
    canvas.disk(centre, radius, {0.96, 0.96, 0.97});
    if (samples.empty()) {
        canvas.text(centre, "no outgoing directions for this light", 11, ink, Align::centre);
        return;
    }
    const Scale scale = colour_scale(samples, log_scale);

    const SampleGrid grid = as_grid(samples);
    const bool is_map = !grid.f.empty() || samples.size() >= 24;
    if (is_map) {
        constexpr int n = 480;
        std::vector<Point> places;
        for (const OutgoingSample& s : samples) {
            const Vec3 w = to_vector(s.wo);
            places.push_back({w.x, w.y});
        }
        std::vector<uint32_t> pixels(n * n);
        // Scattered samples are looked up on a coarser raster, so that thousands of them stay a matter of a
        // second.
        const int step = grid.f.empty() ? 2 : 1;
        for (int py = 0; py < n; py += step) {
            for (int px = 0; px < n; px += step) {
                const double x = 2 * (px + 0.5 * step) / n - 1, y = 1 - 2 * (py + 0.5 * step) / n,
                             r = std::hypot(x, y);
                if (r > 1) continue;
                const double phi_deg = 360 * fractional_part(degrees(std::atan2(y, x)) / 360);
                const double f = grid.f.empty() ? scattered_value(samples, places, {x, y})
                                                : grid.value(degrees(std::asin(r)), phi_deg);
                if (std::isnan(f)) continue;
                for (int k = 0; k < step * step; ++k)
                    pixels[(py + k / step) * n + px + k % step] = argb(viridis(scale.place(f)));
            }
        }
        canvas.image(pixels, n, n, {centre.x - radius, centre.y - radius}, 2 * radius, 2 * radius);
    }
    const Colour line{1, 1, 1};
    for (const double theta_deg : {30.0, 60.0}) {
        canvas.circle(centre, radius * std::sin(radians(theta_deg)), is_map ? line : pale, 0.7);
        canvas.text(at(theta_deg, 270).y > 0 ? Point{centre.x + 4, at(theta_deg, 270).y - 7} : centre,
                    number_text(theta_deg) + "\u00b0", 9.5, is_map ? line : grey);
    }
    canvas.circle(centre, radius, ink, 1);
    if (!is_map || samples.size() <= 200) {
        for (const OutgoingSample& s : samples) {
            const Point p = at(s.wo.theta_deg, s.wo.phi_deg);
            if (is_map)
                canvas.disk(p, 0.9, line);
            else
                canvas.disk(p, 5.5, ink), canvas.disk(p, 4.8, viridis(scale.place(s.f)));
        }
    }
    for (const double phi_deg : {0.0, 90.0, 180.0, 270.0}) {
        const double r = radius + 13;
        canvas.text(
            {centre.x + (r + 3) * std::cos(radians(phi_deg)), centre.y - r * std::sin(radians(phi_deg))},
            number_text(phi_deg) + "\u00b0", 10.5, grey, Align::centre);
    }

    const Point light = at(wi.theta_deg, wi.phi_deg), mirror = at(wi.theta_deg, wi.phi_deg + 180);
    canvas.disk(light, 6.5, ink);
    canvas.disk(light, 5, {1.0, 0.85, 0.25});
    for (const double s : {-1.0, 1.0}) {
        const std::vector<Point> stroke{{mirror.x - 5, mirror.y - 5 * s}, {mirror.x + 5, mirror.y + 5 * s}};
        canvas.line(stroke, ink, 3.6);
        canvas.line(stroke, line, 1.8);
    }
    const double key_y = centre.y + radius + 34;
    canvas.disk({corner.x + 28, key_y}, 5.5, ink);
    canvas.disk({corner.x + 28, key_y}, 4.2, {1.0, 0.85, 0.25});
    canvas.text({corner.x + 39, key_y}, "light", 10.5, ink);
    for (const double s : {-1.0, 1.0})
        canvas.line({{corner.x + 85, key_y - 4.5 * s}, {corner.x + 94, key_y + 4.5 * s}}, ink, 2);
    canvas.text({corner.x + 101, key_y}, "mirror direction", 10.5, ink);

    // Colour bar.
    const double bar_x = centre.x + radius + 34, bar_top = centre.y - 0.8 * radius, bar_height = 1.6 * radius;
    std::vector<uint32_t> bar(256);
    for (int k = 0; k < 256; ++k) bar[k] = argb(viridis(1 - k / 255.0));
    canvas.image(bar, 1, 256, {bar_x, bar_top}, 13, bar_height);
    for (const double value : ticks(scale, 6)) {
        const double y = bar_top + (1 - scale.place(value)) * bar_height;
        canvas.line({{bar_x + 13, y}, {bar_x + 17, y}}, ink, 0.8);
        canvas.text({bar_x + 20, y}, tick_label(value), 10, ink);
    }
    canvas.text({bar_x - 4, bar_top - 13}, "f [1/sr]", 10.5, ink);
}

}  // namespace gonio
