#include "directions/hemisphere_quadrature.h"

namespace gonio {

// Newton's method on P_n from Tricomi's guess; by symmetry only the upper half of the nodes is sought.
Quadrature gauss_legendre(int n, double low, double high) {
    Quadrature rule{std::vector<double>(n), std::vector<double>(n)};
    const double middle = 0.5 * (low + high), half = 0.5 * (high - low);
    for (int k = 0; k < (n + 1) / 2; ++k) {
        double x = std::cos(pi * (k + 0.75) / (n + 0.5)), slope = 0;
        for (int step = 0; step < 100; ++step) {
            double before = 1, legendre = x;
            for (int l = 2; l <= n; ++l) {
                const double next = ((2 * l - 1) * x * legendre - (l - 1) * before) / l;
                before = legendre;
                legendre = next;
            }
            slope = n * (before - x * legendre) / (1 - x * x);
            const double change = legendre / slope;
            x -= change;
            if (std::abs(change) < 1e-15) break;
        }
        const double weight = 2 / ((1 - x * x) * slope * slope) * half;
        rule.nodes[n - 1 - k] = middle + half * x;
        rule.nodes[k] = middle - half * x;
        rule.weights[k] = rule.weights[n - 1 - k] = weight;
    }
    return rule;
}

DirectionSet hemisphere_quadrature(int n_z, int n_phi) {
    const Quadrature rule = gauss_legendre(n_z, 0, 1);
    DirectionSet set;
    for (int j = n_z - 1; j >= 0; --j)
        for (int k = 0; k < n_phi; ++k) {
            const double z = rule.nodes[j], r = safe_sqrt(1 - z * z), phi = 2 * pi * (k + 0.5) / n_phi;
            set.directions.push_back({r * std::cos(phi), r * std::sin(phi), z});
            set.solid_angle.push_back(rule.weights[j] * 2 * pi / n_phi);
        }
    return set;
}

}  // namespace gonio
