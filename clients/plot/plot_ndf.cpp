#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "clients/plot/frame.h"
#include "clients/plot/palette.h"
#include "clients/plot/plot.h"

namespace gonio {
namespace {

// Mean of D over the bins around azimuth `phi_deg` and opposite, within `half_deg`.
double slice(const NdfTable& table, int t, double phi_deg, double half_deg) {
    double sum = 0;
    int n = 0;
    const double step = 360.0 / table.n_phi;
    for (int p = 0; p < table.n_phi; ++p) {
        const double away = std::abs(std::remainder(p * step - phi_deg, 180));
        if (away > std::max(half_deg, 0.5 * step) + 1e-9) continue;
        sum += table.d[static_cast<size_t>(t) * table.n_phi + p];
        ++n;
    }
    return n ? sum / n : 0;
}

std::string legend(const NdfFit& fit) {
    std::string text = fit.model == NdfModel::ggx ? "GGX " : "Beckmann ";
    auto value = [](double v, double se) { return number_text(v, 3) + " \u00b1 " + number_text(se, 1); };
    if (fit.isotropic) return text + "\u03b1 = " + value(fit.alpha, fit.se_alpha);
    return text + "\u03b1x = " + value(fit.alpha_x, fit.se_alpha_x) +
           ", \u03b1y = " + value(fit.alpha_y, fit.se_alpha_y);
}

}  // namespace

void plot_ndf(const NdfResult& ndf, const std::string& path, const std::string& title) {
    const NdfTable& table = ndf.table;
    // The anisotropic fits, or what converged; a density along a line has no D to draw.
    std::vector<const NdfFit*> fits;
    for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx})
        for (const NdfFit& fit : ndf.fits)
            if (fit.model == model && !fit.isotropic && fit.converged && fit.alpha_x > 0 && fit.alpha_y > 0)
                fits.push_back(&fit);
    const double rotation_deg = fits.empty() ? 0 : fits[0]->rotation_deg;

    double highest = 0;
    for (int t = 0; t < table.n_theta(); ++t)
        for (const double axis : {0.0, 90.0})
            highest = std::max(highest, slice(table, t, rotation_deg + axis, 7.5));
    if (!(highest > 0)) throw Error(ErrorCode::invalid_input, "ndf", "", "there is no distribution to draw");

    // To the end of the fine bins, or a bit further: that is where 99.9 % of the facets are.
    const double theta_high = table.theta_edges_deg[std::max(0, table.n_theta() - 10)];
    const Scale x = enclosing_scale(0, theta_high, false);
    const Scale y{highest * 1e-5, highest * 3, true};

    draw_figure(path, 900, 420, [&](Canvas& canvas) {
        canvas.text({20, 22}, title.empty() ? "Normal distribution of the facets" : title, 15, ink,
                    Align::left, true);
        for (int axis = 0; axis < 2; ++axis) {
            const double phi_deg = rotation_deg + 90 * axis;
            const Frame frame{{80 + 430.0 * axis, 62}, 360, 250, x, y};
            frame.draw(canvas, "\u03b8 of the normal [deg]", axis == 0 ? "D [1/sr]" : "");
            canvas.text({frame.corner.x, 50},
                        "azimuth " + number_text(phi_deg, 3) + "\u00b0" +
                            (axis == 0 ? " (axis x of the fit)" : " (axis y)"),
                        11.5, ink);
            for (size_t k = 0; k < fits.size(); ++k) {
                const NdfShape shape{fits[k]->model, fits[k]->alpha_x, fits[k]->alpha_y,
                                     radians(fits[k]->rotation_deg)};
                std::vector<Point> curve;
                for (int s = 0; s <= 300; ++s) {
                    const double theta_deg = x.high * s / 300;
                    const double d = ndf_value(shape, to_vector({std::min(theta_deg, 89.999), phi_deg}));
                    if (d >= y.low) curve.push_back(frame.at(theta_deg, d));
                }
                canvas.line(curve, category_colour(k), 2.2, k == 1);
            }
            for (int t = 0; t < table.n_theta(); ++t) {
                const double d = slice(table, t, phi_deg, 7.5);
                const double theta_deg = 0.5 * (table.theta_edges_deg[t] + table.theta_edges_deg[t + 1]);
                if (d >= y.low && theta_deg <= x.high) canvas.disk(frame.at(theta_deg, d), 2.2, ink);
            }
        }
        double key_x = 80;
        canvas.disk({key_x + 8, 368}, 2.5, ink);
        canvas.text({key_x + 18, 368}, "measured", 11, ink);
        key_x += 100;
        for (size_t k = 0; k < fits.size(); ++k) {
            canvas.line({{key_x, 368}, {key_x + 26, 368}}, category_colour(k), 2.2, k == 1);
            const std::string words = legend(*fits[k]);
            canvas.text({key_x + 32, 368}, words, 11, ink);
            key_x += 60 + canvas.text_width(words, 11);
        }
        if (fits.empty())
            canvas.text({key_x, 368}, "no fitted distribution to draw: " + ndf.fits.at(1).message, 11, ink);
        canvas.text({20, 400},
                    number_text(static_cast<double>(ndf.n_facets), 6) + " facets, worth " +
                        number_text(std::round(ndf.n_effective.alpha), 6) + " independent ones" +
                        (ndf.best >= 0 ? "; the likelihood prefers " + legend(ndf.fits[ndf.best]) : ""),
                    10, grey);
    });
}

}  // namespace gonio
