// A rough dielectric interface (GGX) over something else: what passes it. Light that the visible microfacets
// do not reflect is let through, so lobe and transmitted light never add up to more than arrives.
#pragma once

namespace gonio {

// Share of the light from a direction cos_theta off the normal that passes: the mean of 1 - F over the
// normals that the direction sees. eta in [1, 1e6], alpha in (0, 1]. The same for light that leaves
// (Helmholtz), whatever is below scatters evenly. Out of a table, interpolated: within 0.01 of the mean for
// eta up to 3, and exact for eta = 1.
double coat_transmittance(double eta, double alpha, double cos_theta);

// The nodes of that table, for kernels that look it up side by side:
// transmittance[(e * n_alpha + a) * n_cos + c] at (eta - 1) / (eta + 1) = e / (n_eta - 1),
// alpha = a / (n_alpha - 1) and cos_theta = (c / (n_cos - 1))^2; linear in those three, cos_theta itself
// rather than its root, in between.
struct CoatTable {
    static constexpr int n_eta = 33, n_alpha = 17, n_cos = 65;
    const float* transmittance;
};
CoatTable coat_table();

// Integral of 2 cos_theta coat_transmittance over cos_theta in [0, 1], of the interpolated values exactly.
double mean_coat_transmittance(double eta, double alpha);
// Radiance out of the base, per light that passed the coat, to all orders between base and coat, without the
// two transmittances: albedo for an index of 1, 1 / mean transmittance for a white base.
double coat_base_factor(double eta, double alpha, double albedo);

}  // namespace gonio
