#include "material/coat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "material/fresnel.h"
#include "material/microfacet_distribution.h"

namespace gonio {
namespace {

// Nodes: eta by s = (eta - 1) / (eta + 1), whose square is F at normal incidence; alpha evenly; cos_theta by
// its root, for it is at grazing that F changes fast.
constexpr int n_eta = CoatTable::n_eta, n_alpha = CoatTable::n_alpha, n_cos = CoatTable::n_cos,
              quadrature = 12;

// A place between nodes `first` and `first + 1`.
struct Place {
    int first;
    double share;  // of the second node
};

Place place(double t, int n) {
    const double x = std::clamp(t, 0.0, 1.0) * (n - 1);
    const int first = std::min(static_cast<int>(x), n - 2);
    return {first, x - first};
}
Place eta_place(double eta) {
    return place((eta - 1) / (eta + 1), n_eta);
}
Place alpha_place(double alpha) {
    return place(alpha, n_alpha);
}
double cos_node(int k) {
    const double t = static_cast<double>(k) / (n_cos - 1);
    return t * t;
}
// Linear in the cosine itself, so that the mean is exact.
Place cos_place(double cos_theta) {
    const int first = place(std::sqrt(std::max(0.0, cos_theta)), n_cos).first;
    const double low = cos_node(first), high = cos_node(first + 1);
    return {first, std::clamp((cos_theta - low) / (high - low), 0.0, 1.0)};
}

struct Table {
    std::vector<double> transmittance = std::vector<double>(n_eta * n_alpha * n_cos);
    std::vector<double> mean = std::vector<double>(n_eta * n_alpha);

    double& at(int eta, int alpha, int cos) { return transmittance[(eta * n_alpha + alpha) * n_cos + cos]; }

    Table() {
        std::array<double, n_eta> etas;
        for (int e = 0; e < n_eta; ++e) {
            const double s = static_cast<double>(e) / (n_eta - 1);
            etas[e] = (1 + s) / (1 - s);
        }
        for (int a = 0; a < n_alpha; ++a)
            for (int k = 1; k < n_cos; ++k) {  // nothing passes at cos 0, nor at infinite eta
                const double alpha = std::max(1e-9, static_cast<double>(a) / (n_alpha - 1)), z = cos_node(k);
                const MicrofacetDistribution normals{Microfacet::Distribution::ggx, alpha, alpha};
                const Vec3 w{safe_sqrt(1 - z * z), 0, z};
                const int n = a == 0 ? 1 : quadrature;
                for (int i = 0; i < n; ++i)
                    for (int j = 0; j < n; ++j) {
                        const Vec3 h = normals.sample_visible(w, (i + 0.5) / n, (j + 0.5) / n);
                        const double cos_h = std::clamp(dot(w, h), 0.0, 1.0);
                        for (int e = 0; e + 1 < n_eta; ++e)
                            at(e, a, k) += (1 - fresnel_dielectric(cos_h, etas[e])) / (n * n);
                    }
            }
        for (int a = 0; a < n_alpha; ++a) at(0, a, 0) = 1;
        for (int e = 0; e < n_eta; ++e)
            for (int a = 0; a < n_alpha; ++a)
                for (int k = 0; k + 1 < n_cos; ++k) {
                    // Integral of 2 x (linear from p at x0 to q at x1).
                    const double x0 = cos_node(k), x1 = cos_node(k + 1), p = at(e, a, k), q = at(e, a, k + 1);
                    mean[e * n_alpha + a] += (x1 - x0) / 3 * (p * (2 * x0 + x1) + q * (x0 + 2 * x1));
                }
    }
};

const Table& table() {
    static const Table once;
    return once;
}

template <class Value>
double between(const Place& p, Value&& value) {
    return (1 - p.share) * value(p.first) + p.share * value(p.first + 1);
}

}  // namespace

double coat_transmittance(double eta, double alpha, double cos_theta) {
    const Place c = cos_place(cos_theta), a = alpha_place(alpha);
    return between(eta_place(eta), [&](int e) {
        return between(a, [&](int k) {
            const double* row = &table().transmittance[(e * n_alpha + k) * n_cos];
            return between(c, [&](int m) { return row[m]; });
        });
    });
}

CoatTable coat_table() {
    static const std::vector<float> nodes(table().transmittance.begin(), table().transmittance.end());
    return {nodes.data()};
}

double mean_coat_transmittance(double eta, double alpha) {
    const Place a = alpha_place(alpha);
    return between(eta_place(eta),
                   [&](int e) { return between(a, [&](int k) { return table().mean[e * n_alpha + k]; }); });
}

double coat_base_factor(double eta, double alpha, double albedo) {
    return albedo / (eta * eta * (1 - albedo) + albedo * mean_coat_transmittance(eta, alpha));
}

}  // namespace gonio
