// The normal distribution of a height field's facets, and the Beckmann and GGX distributions nearest to it.
#pragma once
#include <string>
#include <vector>

#include "fitting/ndf_models.h"
#include "surface/facet_mesh.h"
#include "surface/height_field.h"

namespace gonio {

// The measured D. Facets count with their own (not their base) area.
struct NdfTable {
    std::vector<double>
        theta_edges_deg;  // n_theta + 1, from 0 to 90: fine up to where 99.9 % of the base plane is reached
    int n_phi = 0;  // bins of 360 / n_phi degrees; bin k is centred at azimuth k * 360 / n_phi of the normal
    std::vector<double> d;  // [theta][phi], 1/sr, mean over the bin
    double projected_area_norm =
        0;  // integral of D cos(theta) over the bins: 1 but for the width of the bins

    int n_theta() const { return static_cast<int>(theta_edges_deg.size()) - 1; }
};

struct NdfFit {
    NdfModel model = NdfModel::beckmann;
    bool isotropic = true;
    // alpha_x belongs to the axis at rotation_deg, in (-45, 45] degrees from +x towards +y; alpha_y to the
    // axis across. Isotropic: alpha_x == alpha_y == alpha. Else alpha = sqrt(alpha_x alpha_y). alpha_y (or
    // alpha_x) is 0 on a surface that is invariant along an axis: then the model is the marginal distribution
    // of the slopes across that axis.
    double alpha = 0, alpha_x = 0, alpha_y = 0, rotation_deg = 0;
    // Standard errors from the Fisher information of n_effective facets.
    double se_alpha = 0, se_alpha_x = 0, se_alpha_y = 0, se_rotation_deg = 0;
    // Of n_effective facets (that is n_effective times the mean over facets), in slope space; differences
    // between models of one surface mean what they would for independent facets. aic = 2 * parameters - 2 *
    // log_likelihood.
    double log_likelihood = 0, aic = 0;
    bool converged = false;
    std::string message = "fit was not called";
};

// How many independent facets tell as much about each parameter as the correlated ones of the surface.
struct EffectiveSize {
    double alpha = 0, alpha_x = 0, alpha_y = 0, rotation = 0;
};

struct NdfResult {
    NdfTable table;
    long long n_facets = 0;
    EffectiveSize n_effective;
    double mean_slope_x = 0, mean_slope_y = 0, rms_slope_x = 0, rms_slope_y = 0, max_slope = 0;
    std::vector<NdfFit> fits;  // beckmann and ggx, each isotropic and anisotropic
    int best = -1;             // index of the converged fit of least aic; -1 if there is none
    std::string message = "measure_ndf was not called";
};

struct NdfOptions {
    int n_theta = 60, n_phi = 72;  // bins of the table's fine part; >= 1
};

// All facets inside the measured border. Linear in their number; 4096 x 4096 takes seconds and 200 MB.
// Standard errors assume slopes that are jointly normal between places, which sets their correlation only;
// they grow optimistic on surfaces whose slope variance itself wanders over the patch.
NdfResult measure_ndf(const HeightField& surface, const NdfOptions& options = {});

// The four fits to independent slopes (each standing for the same base area), n_effective = their number.
std::vector<NdfFit> fit_ndf(const std::vector<Gradient>& slopes);

// A page for people: the surface's slopes, every fit, which one the likelihood prefers.
std::string ndf_text(const NdfResult& result);

}  // namespace gonio
