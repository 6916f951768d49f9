#include <iomanip>
#include <sstream>

#include "fitting/ndf.h"

namespace gonio {

std::string ndf_text(const NdfResult& r) {
    std::ostringstream text;
    text << std::setprecision(4);
    text << r.n_facets << " facets, worth " << r.n_effective.alpha
         << " independent ones (from the correlation of slopes)\n"
         << "rms slope        x " << r.rms_slope_x << "   y " << r.rms_slope_y << "   steepest "
         << r.max_slope << "\n"
         << "mean slope       x " << r.mean_slope_x << "   y " << r.mean_slope_y << "\n"
         << "integral of D cos(theta) over the tabulated distribution: " << std::setprecision(6)
         << r.table.projected_area_norm << " (1 but for the width of its bins)\n\n";
    text << "  model     form         alpha_x   +- se      alpha_y   +- se      rotation  +- se      "
            "log-likelihood\n";
    for (size_t k = 0; k < r.fits.size(); ++k) {
        const NdfFit& fit = r.fits[k];
        text << (static_cast<int>(k) == r.best ? "* " : "  ") << std::left << std::setw(10)
             << name_of(fit.model) << std::setw(13) << (fit.isotropic ? "isotropic" : "anisotropic");
        text << std::setprecision(4);
        auto pair = [&](double value, double error) {
            text << std::left << std::setw(11) << value << std::setw(11) << error;
        };
        pair(fit.alpha_x, fit.se_alpha_x);
        pair(fit.alpha_y, fit.se_alpha_y);
        pair(fit.rotation_deg, fit.se_rotation_deg);
        text << std::setprecision(7) << fit.log_likelihood;
        if (fit.message != "converged") text << "   " << fit.message;
        text << "\n";
    }
    text << "\n* preferred by likelihood (least AIC). alpha_x along the axis at `rotation` degrees from +x, "
            "alpha_y across it.\n";
    if (r.message != "done") text << "Note: " << r.message << ".\n";
    return text.str();
}

}  // namespace gonio
