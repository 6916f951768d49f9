#include "material/microfacet_distribution.h"

#include <algorithm>

#include "material/local_frame.h"

namespace gonio {
namespace {

// Heitz 2018, "Sampling the GGX distribution of visible normals": a point of the disk as wo sees the unit
// hemisphere. wo is stretched to alpha = 1.
Vec3 visible_normal_ggx(const Vec3& wo, double u1, double u2) {
    const double flat = std::hypot(wo.x, wo.y);
    const Vec3 s = flat > 1e-12 ? Vec3{-wo.y / flat, wo.x / flat, 0} : Vec3{1, 0, 0}, t = cross(wo, s);
    const double r = std::sqrt(u1), phi = 2 * pi * u2, shrink = (1 + wo.z) / 2;
    const double x = r * std::cos(phi), disk = r * std::sin(phi),
                 y = (1 - shrink) * safe_sqrt(1 - x * x) + shrink * disk, z = safe_sqrt(1 - x * x - y * y);
    return {s.x * x + t.x * y + wo.x * z, s.y * x + t.y * y + wo.y * z, s.z * x + t.z * y + wo.z * z};
}

double inverse_erf(double y) {
    const double limit = 1 - 1e-15;
    y = std::clamp(y, -limit, limit);
    // Winitzki's start, then Newton with the exact erf.
    constexpr double a = 0.147;
    const double l = std::log((1 - y) * (1 + y)), b = 2 / (pi * a) + l / 2;
    double x = std::copysign(safe_sqrt(std::sqrt(b * b - l / a) - b), y);
    for (int step = 0; step < 3; ++step)
        x -= (std::erf(x) - y) * std::sqrt(pi) / 2 * std::exp(std::min(x * x, 600.0));
    return x;
}

// Heitz & d'Eon 2014, "Importance sampling microfacet-based BSDFs using the distribution of visible normals":
// the slope towards wo first, by inverting the distribution of (cos - slope sin)+ exp(-slope^2) exactly, then
// the one across. wo is stretched to alpha = 1.
Vec3 visible_normal_beckmann(const Vec3& wo, double u1, double u2) {
    const double sin_o = std::hypot(wo.x, wo.y), cos_o = wo.z;
    double along = inverse_erf(2 * u1 - 1);
    if (sin_o > 1e-9) {
        const double steepest = cos_o / sin_o;
        const auto share_below = [&](double slope) {
            return cos_o * (1 + std::erf(slope)) / 2 + sin_o * std::exp(-slope * slope) / (2 * std::sqrt(pi));
        };
        const double wanted = u1 * share_below(steepest);
        double low = -8, high = std::min(steepest, 8.0);
        along = std::clamp(along, low, high);
        for (int step = 0; step < 60 && high - low > 1e-13 * (1 + std::abs(along)); ++step) {
            const double excess = share_below(along) - wanted;
            (excess > 0 ? high : low) = along;
            const double derivative = (cos_o - along * sin_o) * std::exp(-along * along) / std::sqrt(pi);
            const double newton = along - excess / derivative;
            along = newton > low && newton < high ? newton : (low + high) / 2;
        }
    }
    const double across = inverse_erf(2 * u2 - 1);
    const double cos_phi = sin_o > 1e-9 ? wo.x / sin_o : 1, sin_phi = sin_o > 1e-9 ? wo.y / sin_o : 0;
    // Slopes fall off towards wo where the normal leans to it.
    const double slope_x = cos_phi * along - sin_phi * across, slope_y = sin_phi * along + cos_phi * across;
    return normalized({-slope_x, -slope_y, 1});
}

}  // namespace

double MicrofacetDistribution::density(const Vec3& h) const {
    if (h.z <= 0) return 0;
    const double area = alpha_x * alpha_y, x = h.x * alpha_y, y = h.y * alpha_x, z_2 = h.z * h.z;
    if (kind == Microfacet::Distribution::beckmann)
        return std::exp(-(x * x + y * y) / (area * area * z_2)) / (pi * area * z_2 * z_2);
    // With both sides of q = tan^2 / alpha^2 z^2 + z^2 times area^2, one division does: the path tracer
    // spends its time here.
    const double q = x * x + y * y + area * area * z_2;
    return area * area * area / (pi * q * q);
}

double MicrofacetDistribution::lambda(const Vec3& w) const {
    const double x = alpha_x * w.x, y = alpha_y * w.y, tan_squared = (x * x + y * y) / (w.z * w.z);
    if (kind == Microfacet::Distribution::ggx) return (std::sqrt(1 + tan_squared) - 1) / 2;
    if (tan_squared < 1e-4) return 0;  // below 1e-1000
    const double a = 1 / std::sqrt(tan_squared);
    return std::exp(-a * a) / (2 * a * std::sqrt(pi)) - std::erfc(a) / 2;
}

Vec3 MicrofacetDistribution::sample_visible(const Vec3& wo, double u1, double u2) const {
    const Vec3 stretched = normalized({alpha_x * wo.x, alpha_y * wo.y, wo.z});
    const Vec3 h = kind == Microfacet::Distribution::ggx ? visible_normal_ggx(stretched, u1, u2)
                                                         : visible_normal_beckmann(stretched, u1, u2);
    return normalized({alpha_x * h.x, alpha_y * h.y, std::max(h.z, 1e-300)});
}

}  // namespace gonio
