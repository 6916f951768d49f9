#include "material/facet_brdf.h"

#include <algorithm>

#include "material/lobes.h"

namespace gonio {
namespace {

bool is_delta(const Lobe& lobe) {
    return std::holds_alternative<Mirror>(lobe);
}

}  // namespace

FacetBrdf::FacetBrdf(const Material& material, const HeightField& surface, int kind, int i, int j)
    : material_(material),
      gradient_(facet_gradient(surface, kind, i, j)),
      frame_(gradient_, 0),
      i_(i),
      j_(j) {}

LocalFrame FacetBrdf::frame_of(const Lobe& lobe) const {
    const auto* microfacet = std::get_if<Microfacet>(&lobe);
    const double rotation_deg = microfacet ? microfacet->rotation_deg.at(0, i_, j_) : 0.0;
    return rotation_deg == 0 ? frame_ : LocalFrame(gradient_, rotation_deg);
}

void FacetBrdf::eval(const Vec3& wi, const Vec3& wo, std::span<double> f) const {
    std::fill(f.begin(), f.end(), 0.0);
    if (!(dot(normal(), wi) > 0 && dot(normal(), wo) > 0)) return;
    const Cell cell{i_, j_};
    for (const WeightedLobe& part : material_.lobes) {
        const LocalFrame frame = frame_of(part.lobe);
        std::visit(
            [&](const auto& lobe) {
                add_f(lobe, cell, part.weight, frame.to_local(wi), frame.to_local(wo), f);
            },
            part.lobe);
    }
}

// Of lobe k, not yet divided by the sum over the lobes: what it reflects, averaged over the channels.
double FacetBrdf::odds(size_t k, double cos_o) const {
    const WeightedLobe& part = material_.lobes[k];
    const size_t n = material_.channels.size();
    double sum = 0;
    for (size_t c = 0; c < n; ++c)
        sum += part.weight.at(c, i_, j_) * std::visit(
                                               [&](const auto& lobe) {
                                                   return reflected(lobe, {i_, j_}, c, cos_o);
                                               },
                                               part.lobe);
    return sum / static_cast<double>(n);
}

double FacetBrdf::sum_of_odds(double cos_o) const {
    double sum = 0;
    for (size_t k = 0; k < material_.lobes.size(); ++k) sum += odds(k, cos_o);
    return sum;
}

double FacetBrdf::pdf(const Vec3& wo, const Vec3& wi) const {
    const double cos_o = dot(normal(), wo), all = sum_of_odds(cos_o);
    if (!(cos_o > 0 && dot(normal(), wi) > 0 && all > 0)) return 0;
    const Cell cell{i_, j_};
    double sum = 0;
    for (size_t k = 0; k < material_.lobes.size(); ++k) {
        const Lobe& any = material_.lobes[k].lobe;
        const LocalFrame frame = frame_of(any);
        sum += odds(k, cos_o) / all *
               std::visit(
                   [&](const auto& lobe) {
                       return gonio::pdf(lobe, cell, frame.to_local(wo), frame.to_local(wi));
                   },
                   any);
    }
    return sum;
}

std::optional<FacetBrdf::Sample> FacetBrdf::sample(const Vec3& wo, double u_lobe, double u1, double u2,
                                                   std::span<double> weight) const {
    const double cos_o = dot(normal(), wo), all = sum_of_odds(cos_o);
    if (!(cos_o > 0 && all > 0)) return std::nullopt;
    size_t chosen = 0;
    double left = u_lobe * all;
    for (; chosen + 1 < material_.lobes.size() && left >= odds(chosen, cos_o); ++chosen)
        left -= odds(chosen, cos_o);
    const double chance = odds(chosen, cos_o) / all;
    if (!(chance > 0)) return std::nullopt;

    const Cell cell{i_, j_};
    const WeightedLobe& part = material_.lobes[chosen];
    const LocalFrame frame = frame_of(part.lobe);
    const Vec3 local = std::visit(
        [&](const auto& lobe) { return gonio::sample(lobe, cell, frame.to_local(wo), u1, u2); }, part.lobe);
    const Vec3 wi = frame.to_world(local);
    const double cos_i = dot(normal(), wi);
    if (!(cos_i > 0)) return std::nullopt;
    if (const auto* mirror = std::get_if<Mirror>(&part.lobe)) {
        for (size_t c = 0; c < weight.size(); ++c)
            weight[c] = part.weight.at(c, i_, j_) * reflected(*mirror, cell, c, cos_o) / chance;
        return Sample{wi, chance, true};
    }
    const double density = pdf(wo, wi);
    if (!(density > 0)) return std::nullopt;
    eval(wi, wo, weight);
    for (double& w : weight) w *= cos_i / density;
    return Sample{wi, density, false};
}

bool FacetBrdf::has_delta() const {
    return std::any_of(material_.lobes.begin(), material_.lobes.end(),
                       [](const WeightedLobe& part) { return is_delta(part.lobe); });
}

bool FacetBrdf::has_density() const {
    return std::any_of(material_.lobes.begin(), material_.lobes.end(),
                       [](const WeightedLobe& part) { return !is_delta(part.lobe); });
}

}  // namespace gonio
