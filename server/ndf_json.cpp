#include "server/ndf_json.h"

#include <nlohmann/json.hpp>

#include "server/job_hash.h"

namespace gonio {
namespace {

using nlohmann::ordered_json;

ordered_json to_json(const NdfFit& fit) {
    return {{"model", name_of(fit.model)},
            {"isotropic", fit.isotropic},
            {"alpha", fit.alpha},
            {"se_alpha", fit.se_alpha},
            {"alpha_x", fit.alpha_x},
            {"se_alpha_x", fit.se_alpha_x},
            {"alpha_y", fit.alpha_y},
            {"se_alpha_y", fit.se_alpha_y},
            {"rotation_deg", fit.rotation_deg},
            {"se_rotation_deg", fit.se_rotation_deg},
            {"log_likelihood", fit.log_likelihood},
            {"aic", fit.aic},
            {"converged", fit.converged},
            {"message", fit.message}};
}

}  // namespace

std::string ndf_json(const LoadedSurface& surface, const NdfResult& ndf) {
    ordered_json fits = ordered_json::array();
    for (const NdfFit& fit : ndf.fits) fits.push_back(to_json(fit));
    const ordered_json j{{"program", program_version()},
                         {"surface", surface.description},
                         {"surface_hash", surface.hash},
                         {"n_facets", ndf.n_facets},
                         {"n_effective",
                          {{"alpha", ndf.n_effective.alpha},
                           {"alpha_x", ndf.n_effective.alpha_x},
                           {"alpha_y", ndf.n_effective.alpha_y},
                           {"rotation", ndf.n_effective.rotation}}},
                         {"mean_slope_x", ndf.mean_slope_x},
                         {"mean_slope_y", ndf.mean_slope_y},
                         {"rms_slope_x", ndf.rms_slope_x},
                         {"rms_slope_y", ndf.rms_slope_y},
                         {"max_slope", ndf.max_slope},
                         {"message", ndf.message},
                         {"best", ndf.best < 0 ? ordered_json() : ordered_json(ndf.best)},
                         {"fits", fits},
                         {"table",
                          {{"theta_edges_deg", ndf.table.theta_edges_deg},
                           {"n_phi", ndf.table.n_phi},
                           {"d", ndf.table.d},
                           {"projected_area_norm", ndf.table.projected_area_norm}}}};
    return j.dump(2, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace gonio
