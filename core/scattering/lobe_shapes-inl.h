// The shapes of facet reflectances on vectors of facets or directions: what lobe_rows.cpp and lobe_direct.cpp
// compile for every instruction set (Highway's way: included once for each of them).
#if defined(GONIO_SCATTERING_LOBE_SHAPES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GONIO_SCATTERING_LOBE_SHAPES_INL_H
#undef GONIO_SCATTERING_LOBE_SHAPES_INL_H
#else
#define GONIO_SCATTERING_LOBE_SHAPES_INL_H
#endif

#include <hwy/highway.h>
// After highway.h.
#include <hwy/contrib/math/math-inl.h>

#include "material/coat.h"
#include "scattering/slot_material.h"

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using DU = hn::RebindToUnsigned<D>;
using DI = hn::RebindToSigned<D>;
using VF = hn::Vec<D>;
using VI = hn::Vec<DI>;
using Shape = SlotLobe::Shape;

constexpr float least_cosine = 1e-9f;

constexpr bool is_microfacet(Shape shape) {
    return shape == Shape::ggx || shape == Shape::beckmann;
}

HWY_INLINE VF reciprocal(VF x) {
    const VF r = hn::ApproximateReciprocal(x);
    return hn::Mul(r, hn::NegMulAdd(x, r, hn::Set(D(), 2.0f)));
}
HWY_INLINE VF reciprocal_sqrt(VF x) {
    const VF r = hn::ApproximateReciprocalSqrt(x), half = hn::Mul(hn::Mul(x, r), hn::Set(D(), 0.5f));
    return hn::Mul(r, hn::NegMulAdd(half, r, hn::Set(D(), 1.5f)));
}
HWY_INLINE VF dot(VF ax, VF ay, VF az, VF bx, VF by, VF bz) {
    return hn::MulAdd(ax, bx, hn::MulAdd(ay, by, hn::Mul(az, bz)));
}
HWY_INLINE VF square(VF x) {
    return hn::Mul(x, x);
}

// exp(a^2) erfc(a) for a >= 0: Numerical Recipes' Chebyshev fit, 1.2e-7.
HWY_INLINE VF scaled_erfc(VF a) {
    const D d;
    const VF t = hn::Div(hn::Set(d, 1.0f), hn::MulAdd(a, hn::Set(d, 0.5f), hn::Set(d, 1.0f)));
    VF p = hn::Set(d, 0.17087277f);
    for (const float c : {-0.82215223f, 1.48851587f, -1.13520398f, 0.27886807f, -0.18628806f, 0.09678418f,
                          0.37409196f, 1.00002368f, -1.26551223f})
        p = hn::MulAdd(p, t, hn::Set(d, c));
    return hn::Mul(t, hn::Exp(d, p));
}

// What a direction contributes to a lobe of one facet: cosine z; s, of which za sb + zb sa is
// 2 za zb (1 + Lambda_a + Lambda_b) (or what passes the coat); its tangential parts over alpha.
struct Factors {
    VF z, s, x, y;
};

// The numbers of a lobe for the facets of one vector, or of one facet in all lanes.
struct LobeNumbers {
    VF weight, alpha2, sharpness, eta, k, alpha_x4, alpha_y4;
    VF tx, ty, tz, bx, by, bz;
    VI coat_nodes;              // the first of the coat table's for this index and alpha,
    VF eta_share, alpha_share;  // and how much the next ones count
    const float* transmittance;
};

// t, cut to [0, n], as the node below it (n - 1 at most) and the share of the one above.
HWY_INLINE VI node_below(VF t, int n, VF& share) {
    const D d;
    const DI di;
    const VF inside = hn::Clamp(t, hn::Zero(d), hn::Set(d, static_cast<float>(n)));
    const VI node = hn::Min(hn::ConvertTo(di, inside), hn::Set(di, n - 1));
    share = hn::Sub(inside, hn::ConvertTo(d, node));
    return node;
}

// Where the table of coats (material/coat.h) is looked up for what does not depend on directions.
HWY_INLINE void place_coat(VF eta, VF alpha, LobeNumbers& n) {
    const D d;
    const DI di;
    constexpr int last_eta = CoatTable::n_eta - 1, last_alpha = CoatTable::n_alpha - 1;
    // From the end of infinite index: next to it 1 - (eta - 1) / (eta + 1) would cancel.
    VF from_end;
    const VI before_last =
        node_below(hn::Div(hn::Set(d, 2.0f * last_eta), hn::Add(eta, hn::Set(d, 1.0f))), last_eta, from_end);
    const VI eta_node = hn::Sub(hn::Set(di, last_eta - 1), before_last);
    n.eta_share = hn::Sub(hn::Set(d, 1.0f), from_end);
    const VI alpha_node =
        node_below(hn::Mul(alpha, hn::Set(d, static_cast<float>(last_alpha))), last_alpha, n.alpha_share);
    n.coat_nodes = hn::Mul(hn::Add(hn::Mul(eta_node, hn::Set(di, CoatTable::n_alpha)), alpha_node),
                           hn::Set(di, CoatTable::n_cos));
    n.transmittance = coat_table().transmittance;
}

// What passes the coat.
HWY_INLINE VF coat_passes(const LobeNumbers& n, VF z) {
    const D d;
    constexpr int last = CoatTable::n_cos - 1;
    VF unused;
    const VI node = node_below(hn::Mul(hn::Sqrt(z), hn::Set(d, static_cast<float>(last))), last, unused);
    const VF low = hn::ConvertTo(d, node);  // nodes stand at the squares
    const VF share =
        hn::Clamp(hn::Div(hn::MulSub(z, hn::Set(d, static_cast<float>(last * last)), square(low)),
                          hn::MulAdd(low, hn::Set(d, 2.0f), hn::Set(d, 1.0f))),
                  hn::Zero(d), hn::Set(d, 1.0f));
    const VI at = hn::Add(n.coat_nodes, node);
    const auto between = [](VF a, VF b, VF t) HWY_ATTR { return hn::MulAdd(t, hn::Sub(b, a), a); };
    const auto of_row = [&](int row) HWY_ATTR {
        const float* nodes = n.transmittance + row * CoatTable::n_cos;
        return between(hn::GatherIndex(d, nodes, at), hn::GatherIndex(d, nodes + 1, at), share);
    };
    return between(between(of_row(0), of_row(1), n.alpha_share),
                   between(of_row(CoatTable::n_alpha), of_row(CoatTable::n_alpha + 1), n.alpha_share),
                   n.eta_share);
}

template <Shape shape, bool aniso, bool fresnel, class Load>
HWY_INLINE LobeNumbers load_numbers(const SlotLobe& lobe, Load&& load) {
    LobeNumbers n;
    n.weight = load(lobe.weight);
    if constexpr (is_microfacet(shape)) {
        if constexpr (aniso) {
            n.tx = load(lobe.tangent_x), n.ty = load(lobe.tangent_y), n.tz = load(lobe.tangent_z);
            n.bx = load(lobe.bitangent_x), n.by = load(lobe.bitangent_y), n.bz = load(lobe.bitangent_z);
            n.alpha_x4 = load(lobe.alpha_x4), n.alpha_y4 = load(lobe.alpha_y4);
        } else {
            n.alpha2 = load(lobe.alpha2);
            n.sharpness = load(lobe.sharpness);
        }
        if constexpr (fresnel) n.eta = load(lobe.eta), n.k = load(lobe.k);
    } else if constexpr (shape == Shape::coat_base) {
        place_coat(load(lobe.coat_eta), load(lobe.coat_alpha), n);
    } else {
        n.sharpness = load(lobe.sharpness);
    }
    return n;
}

template <Shape shape, bool aniso>
HWY_INLINE Factors factors_of(const LobeNumbers& n, VF z, VF dx, VF dy, VF dz) {
    const D d;
    Factors f;
    f.z = hn::Max(z, hn::Set(d, least_cosine));
    f.s = f.x = f.y = hn::Zero(d);
    if constexpr (is_microfacet(shape)) {
        // alpha^2 sin^2, and z^2 + that
        VF rough2, s2;
        if constexpr (aniso) {
            f.x = dot(n.tx, n.ty, n.tz, dx, dy, dz);
            f.y = dot(n.bx, n.by, n.bz, dx, dy, dz);
            rough2 = hn::MulAdd(n.alpha_x4, square(f.x), hn::Mul(n.alpha_y4, square(f.y)));
            s2 = hn::MulAdd(f.z, f.z, rough2);
        } else {
            const VF z2 = square(f.z), one = hn::Set(d, 1.0f);
            rough2 = hn::Mul(n.alpha2, hn::Max(hn::Zero(d), hn::Sub(one, z2)));
            s2 = hn::MulAdd(hn::Sub(one, n.alpha2), z2, n.alpha2);
        }
        if constexpr (shape == Shape::ggx) {
            f.s = hn::Mul(s2, reciprocal_sqrt(s2));  // z is at least least_cosine
        } else {
            // Lambda = (exp(-a^2) / (a sqrt(pi)) - erfc(a)) / 2, a = cot / alpha
            const VF a =
                hn::Min(hn::Div(f.z, hn::Sqrt(hn::Max(rough2, hn::Set(d, 1e-30f)))), hn::Set(d, 9.0f));
            const VF scaled = hn::Sub(hn::Div(hn::Set(d, 0.564189584f), a), scaled_erfc(a));
            const VF lambda2 = hn::Mul(hn::Exp(d, hn::Neg(square(a))), hn::Max(scaled, hn::Zero(d)));
            f.s = hn::MulAdd(f.z, lambda2, f.z);
        }
    } else if constexpr (shape == Shape::coat_base) {
        f.s = coat_passes(n, f.z);
    }
    return f;
}

// cos^2 of the angle between a direction and the half vector to another, cos_ab from it.
HWY_INLINE VF cos_2_to_half(VF cos_ab) {
    const D d;
    const VF one = hn::Set(d, 1.0f);
    return hn::Mul(hn::Set(d, 0.5f), hn::Add(one, hn::Clamp(cos_ab, hn::Neg(one), one)));
}

// Fresnel's equations as in material/fresnel.h; cos_2 of the angle to the half vector.
HWY_INLINE VF fresnel_factor(VF cos_2, VF eta, VF k) {
    const D d;
    const VF zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const VF c = hn::Sqrt(cos_2), sin_2 = hn::Max(zero, hn::Sub(one, cos_2));
    const VF real = hn::Sub(hn::MulSub(eta, eta, square(k)), sin_2),
             imaginary = hn::Mul(hn::Set(d, 2.0f), hn::Mul(eta, k));
    const VF length = hn::Sqrt(hn::MulAdd(real, real, square(imaginary)));
    const VF tiny = hn::Set(d, 1e-30f), half = hn::Set(d, 0.5f);
    const VF u = hn::IfThenElse(
        hn::Gt(real, zero), hn::Sqrt(hn::Mul(half, hn::Add(length, real))),
        hn::Div(imaginary, hn::Sqrt(hn::Max(tiny, hn::Mul(hn::Set(d, 2.0f), hn::Sub(length, real))))));
    const VF cu = hn::Mul(hn::Mul(hn::Set(d, 2.0f), c), u), sum = hn::Add(length, cos_2);
    const VF s = hn::Div(hn::Sub(sum, cu), hn::Max(tiny, hn::Add(sum, cu)));
    const VF a = hn::MulAdd(cos_2, length, square(sin_2)), b = hn::Mul(cu, sin_2);
    const VF p = hn::Div(hn::Sub(a, b), hn::Max(tiny, hn::Add(a, b)));
    return hn::Mul(hn::Mul(half, s), hn::Add(one, p));
}

// A microfacet lobe over its weight, from the sums of both directions' factors. smith: za sb + zb sa; or
// sa / za + sb / zb, which gives the lobe times za zb for less. inverse2: 1 / |a + b|^2.
template <Shape shape, bool aniso, bool fresnel>
HWY_INLINE VF microfacet_value(const LobeNumbers& n, VF sum_z, VF sum_x, VF sum_y, VF smith, VF cos_ab,
                               VF inverse2) {
    const D d;
    const VF one = hn::Set(d, 1.0f), nh2 = hn::Min(hn::Mul(square(sum_z), inverse2), one);
    // tan^2 / alpha^2, times nh2. 1 - cos^2 first: of a narrow lobe's sharpness, 1e12, nothing is left of a 1
    // added to it.
    const auto slope2_and = [&](VF more) HWY_ATTR {
        if constexpr (aniso)
            return hn::MulAdd(hn::MulAdd(sum_x, sum_x, square(sum_y)), inverse2, more);
        else
            return hn::MulAdd(hn::Sub(one, nh2), n.sharpness, more);
    };
    const VF least = hn::Set(d, 1e-30f);  // what pads a tile has no normal
    VF value;
    if constexpr (shape == Shape::ggx) {
        const VF below = hn::Mul(square(slope2_and(nh2)), smith);  // isotropic: at least the cosines' square
        value = reciprocal(aniso ? hn::Max(below, least) : below);
    } else {
        const VF safe2 = hn::Max(nh2, hn::Set(d, 1e-12f));
        const VF falls =
            hn::Exp(d, hn::Neg(hn::Min(hn::Div(slope2_and(hn::Zero(d)), safe2), hn::Set(d, 80.0f))));
        value = hn::Mul(falls, reciprocal(hn::Max(hn::Mul(square(safe2), smith), least)));
    }
    if constexpr (fresnel) value = hn::Mul(value, fresnel_factor(cos_2_to_half(cos_ab), n.eta, n.k));
    return value;
}

// Any lobe over its weight. cos_ab between the two directions, inverse2: 1 / |a + b|^2.
template <Shape shape, bool aniso, bool fresnel>
HWY_INLINE VF lobe_value(const LobeNumbers& n, const Factors& a, const Factors& b, VF cos_ab, VF inverse2) {
    const D d;
    if constexpr (is_microfacet(shape)) {
        return microfacet_value<shape, aniso, fresnel>(
            n, hn::Add(a.z, b.z), hn::Add(a.x, b.x), hn::Add(a.y, b.y),
            hn::MulAdd(a.z, b.s, hn::Mul(b.z, a.s)), cos_ab, inverse2);
    } else if constexpr (shape == Shape::coat_base) {
        return hn::Mul(a.s, b.s);
    } else {
        const VF one = hn::Set(d, 1.0f), least = hn::Set(d, 1e-30f);
        if constexpr (shape == Shape::phong) {
            const VF mirrored = hn::MulSub(hn::Add(a.z, a.z), b.z, cos_ab);
            const VF power = hn::Exp(d, hn::Mul(n.sharpness, hn::Log(d, hn::Clamp(mirrored, least, one))));
            const auto there = hn::Or(hn::Gt(mirrored, hn::Zero(d)), hn::Le(n.sharpness, hn::Zero(d)));
            return hn::IfThenElseZero(there, power);
        } else {
            const VF nh2 = hn::Clamp(hn::Mul(square(hn::Add(a.z, b.z)), inverse2), least, one);
            return hn::Exp(d, hn::Mul(hn::Mul(n.sharpness, hn::Set(d, 0.5f)), hn::Log(d, nh2)));
        }
    }
}

// Calls visit.template operator()<shape, aniso, fresnel>(). fresnel: of lobes that have the factor, whether
// it is wanted.
template <class Visit>
HWY_INLINE void with_lobe(const SlotLobe& lobe, bool fresnel, Visit&& visit) {
    auto microfacet = [&]<Shape shape>() {
        if (lobe.anisotropic)
            fresnel ? visit.template operator()<shape, true, true>()
                    : visit.template operator()<shape, true, false>();
        else
            fresnel ? visit.template operator()<shape, false, true>()
                    : visit.template operator()<shape, false, false>();
    };
    switch (lobe.shape) {
        case Shape::ggx:
            return microfacet.template operator()<Shape::ggx>();
        case Shape::beckmann:
            return microfacet.template operator()<Shape::beckmann>();
        case Shape::blinn_phong:
            return visit.template operator()<Shape::blinn_phong, false, false>();
        case Shape::phong:
            return visit.template operator()<Shape::phong, false, false>();
        case Shape::coat_base:
            return visit.template operator()<Shape::coat_base, false, false>();
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#endif  // toggled include guard
