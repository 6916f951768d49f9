// A BRDF as coefficients of spherical (SH) or hemispherical (HSH) harmonics, from a quadrature grid or from
// several hundred sparse random samples (Heidrich et al. 2000, sec. 6) by regularised least squares
// (ridge_fit.h).
//
// What is projected is g = f or g = f cos_i cos_o (ProjectionPlan::Weighting), zero below the horizon. SH are
// fitted with these zeros: without them the fit is free below the horizon and its condition number is 1e5
// (order 8, 400 samples) instead of 2. HSH live above the horizon only and follow lobes that it cuts 1.4 to 6
// times better; use SH where they are to be rotated or multiplied with the SH of a light. Order 8 (64
// coefficients a direction) cannot follow lobes narrower than alpha = 0.4 of GGX.
#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "measure/plan.h"
#include "table/table.h"

namespace gonio {

struct HarmonicProjection {
    ProjectionPlan plan;
    std::vector<AnglesDeg> incident;  // per_light: the lights; else empty
    std::vector<std::string> channels;
    int orders = 0;  // slices of orders of scattering, as in Table
    // [channel][slice][set][k]. per_light: a set a light, k = harmonic_index(l, m) of the view, order^2 of
    // them. matrix: one set, k = index_incident * order^2 + index_outgoing. joint: one set, k counts
    // joint_basis(order, isotropic). Unit: that of g, 1/sr. se: standard errors of the values of the table
    // carried over as if independent (the values of a run share its random shifts: what they have in common
    // is not in it); bias: bound by the sum of the absolute shares.
    std::vector<double> coefficients, se, bias;
    // [channel][slice][set]: rms error of the reconstructed g over rms g. Of samples: each against the fit to
    // all others, noise included. Of a quadrature grid: at its nodes. 0 where g is 0.
    std::vector<double> relative_error;
    std::vector<double> ridge;  // [channel][slice][set]; of a matrix: of the outgoing side
    double condition_number =
        1;                    // of the fit, before the ridge; the worst of several. 1 for a quadrature grid
    double sample_noise = 0;  // rms standard error of the values g over rms g, all channels
    // Isotropic joint projections of samples: rms difference of pairs turned around z over rms g, and the
    // part of it that the standard errors explain. The model averages over what is more.
    std::optional<std::pair<double, double>> isotropy_defect;
    std::vector<std::pair<std::string, std::string>> provenance;  // that of the table

    size_t slices() const { return static_cast<size_t>(orders) + 1; }
    size_t n_sets() const { return incident.empty() ? 1 : incident.size(); }
    size_t n_coefficients() const;  // of a set
    size_t set_index(size_t channel, size_t slice, size_t set) const {
        return (channel * slices() + slice) * n_sets() + set;
    }
};

// table: measured where set_projection_directions() says, or, with plan.samples > 0, anywhere: then its rows
// are the samples, and plan.samples counts for nothing but the twins. Throws Error(invalid_input) for fewer
// samples than unknowns, a matrix of a table of pairs, a grid that is not that of the plan; Error(limit) for
// fits beyond 4096 unknowns or 1 GiB.
HarmonicProjection project(const Table& table, const ProjectionPlan& plan);

// Throws Error for an order that is out of range or, in a joint fit, too much.
void check_projection(const ProjectionPlan& plan);

// The least number of samples (as ProjectionPlan counts them) of a plan.
long long least_samples(const ProjectionPlan& plan);

// What the projection says of the BRDF, as a table of every incident with every outgoing direction: f in
// 1/sr, its standard errors and biases carried over from the coefficients (what the basis cannot follow is in
// relative_error alone). per_light: `incident` must be lights of the projection, else Error(invalid_input).
Table reconstruct(const HarmonicProjection& projection, const std::vector<AnglesDeg>& incident,
                  const std::vector<AnglesDeg>& outgoing);

}  // namespace gonio
