#include "scattering/lobe_kernels.h"

#include <algorithm>
#include <cmath>

#include "material/coat.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scattering/lobe_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h.
#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using DU = hn::RebindToUnsigned<D>;
using VF = hn::Vec<D>;
using Shape = SlotLobe::Shape;

constexpr float least_cosine = 1e-9f;

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
};

template <Shape shape, bool aniso, bool fresnel, class Load>
HWY_INLINE LobeNumbers load_numbers(const SlotLobe& lobe, Load&& load) {
    LobeNumbers n;
    n.weight = load(lobe.weight);
    if constexpr (shape == Shape::ggx || shape == Shape::beckmann) {
        if constexpr (aniso) {
            n.tx = load(lobe.tangent_x), n.ty = load(lobe.tangent_y), n.tz = load(lobe.tangent_z);
            n.bx = load(lobe.bitangent_x), n.by = load(lobe.bitangent_y), n.bz = load(lobe.bitangent_z);
            n.alpha_x4 = load(lobe.alpha_x4), n.alpha_y4 = load(lobe.alpha_y4);
        } else {
            n.alpha2 = load(lobe.alpha2);
            n.sharpness = load(lobe.sharpness);
        }
        if constexpr (fresnel) n.eta = load(lobe.eta), n.k = load(lobe.k);
    } else if constexpr (shape != Shape::coat_base) {
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
    if constexpr (shape == Shape::ggx || shape == Shape::beckmann) {
        VF rough2;  // alpha^2 sin^2
        if constexpr (aniso) {
            f.x = dot(n.tx, n.ty, n.tz, dx, dy, dz);
            f.y = dot(n.bx, n.by, n.bz, dx, dy, dz);
            rough2 = hn::MulAdd(n.alpha_x4, square(f.x), hn::Mul(n.alpha_y4, square(f.y)));
        } else {
            rough2 = hn::Mul(n.alpha2, hn::Max(hn::Zero(d), hn::NegMulAdd(f.z, f.z, hn::Set(d, 1.0f))));
        }
        if constexpr (shape == Shape::ggx) {
            f.s = hn::Sqrt(hn::MulAdd(f.z, f.z, rough2));
        } else {
            // Lambda = (exp(-a^2) / (a sqrt(pi)) - erfc(a)) / 2, a = cot / alpha
            const VF a =
                hn::Min(hn::Div(f.z, hn::Sqrt(hn::Max(rough2, hn::Set(d, 1e-30f)))), hn::Set(d, 9.0f));
            const VF scaled = hn::Sub(hn::Div(hn::Set(d, 0.564189584f), a), scaled_erfc(a));
            const VF lambda2 = hn::Mul(hn::Exp(d, hn::Neg(square(a))), hn::Max(scaled, hn::Zero(d)));
            f.s = hn::MulAdd(f.z, lambda2, f.z);
        }
    }
    return f;
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

// cos_ab between the two directions, inverse: 1 / |a + b|.
template <Shape shape, bool aniso, bool fresnel>
HWY_INLINE VF lobe_value(const LobeNumbers& n, const Factors& a, const Factors& b, VF cos_ab, VF inverse) {
    const D d;
    const VF one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    if constexpr (shape == Shape::coat_base) {
        return hn::Mul(n.weight, hn::Mul(a.s, b.s));
    } else if constexpr (shape == Shape::phong) {
        const VF mirrored = hn::MulSub(hn::Add(a.z, a.z), b.z, cos_ab);
        const VF power =
            hn::Exp(d, hn::Mul(n.sharpness, hn::Log(d, hn::Clamp(mirrored, hn::Set(d, 1e-30f), one))));
        const auto there = hn::Or(hn::Gt(mirrored, zero), hn::Le(n.sharpness, zero));
        return hn::IfThenElseZero(there, hn::Mul(n.weight, power));
    } else {
        const VF nh = hn::Min(hn::Mul(hn::Add(a.z, b.z), inverse), one), nh2 = square(nh);
        if constexpr (shape == Shape::blinn_phong) {
            const VF log = hn::Log(d, hn::Max(nh, hn::Set(d, 1e-30f)));
            return hn::Mul(n.weight, hn::Exp(d, hn::Mul(n.sharpness, log)));
        } else {
            VF slope2;  // tan^2 over alpha^2, times nh^2
            if constexpr (aniso)
                slope2 = hn::Mul(hn::MulAdd(hn::Add(a.x, b.x), hn::Add(a.x, b.x), square(hn::Add(a.y, b.y))),
                                 square(inverse));
            else
                slope2 = hn::Mul(hn::Sub(one, nh2), n.sharpness);
            const VF smith = hn::MulAdd(a.z, b.s, hn::Mul(b.z, a.s));
            const VF least = hn::Set(d, 1e-30f);  // what pads a tile has no normal
            VF value;
            if constexpr (shape == Shape::ggx) {
                value = hn::Mul(n.weight,
                                reciprocal(hn::Max(hn::Mul(square(hn::Add(slope2, nh2)), smith), least)));
            } else {
                const VF safe2 = hn::Max(nh2, hn::Set(d, 1e-12f));
                const VF falls = hn::Exp(d, hn::Neg(hn::Min(hn::Div(slope2, safe2), hn::Set(d, 80.0f))));
                value = hn::Mul(hn::Mul(n.weight, falls),
                                reciprocal(hn::Max(hn::Mul(square(safe2), smith), least)));
            }
            if constexpr (fresnel) {
                const VF cos_2 =
                    hn::Mul(hn::Set(d, 0.5f), hn::Add(one, hn::Clamp(cos_ab, hn::Neg(one), one)));
                value = hn::Mul(value, fresnel_factor(cos_2, n.eta, n.k));
            }
            return value;
        }
    }
}

// What passes the coat, from the table of the material: not one of the fast shapes.
HWY_INLINE VF coat_factors(const SlotLobe& lobe, const size_t* slots, VF z) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    HWY_ALIGN float values[16];
    hn::Store(z, d, values);
    for (size_t k = 0; k < lanes; ++k)
        values[k] = static_cast<float>(
            coat_transmittance(lobe.coat_eta[slots[k]], lobe.coat_alpha[slots[k]], values[k]));
    return hn::Load(d, values);
}

template <Shape shape, bool aniso, bool fresnel>
void rows_of_lobe(const SlotLobe& lobe, const Tile& tile, size_t n_rows, const uint32_t* slot,
                  const float* wx, const float* wy, const float* wz, const DirectionArrays& directions,
                  float* out) {
    const D d;
    const size_t lanes = hn::Lanes(d), padded = directions.x.size();
    for (size_t r = 0; r < n_rows; ++r, out += padded) {
        const size_t at = slot[r];
        size_t same_slots[16];
        std::fill_n(same_slots, 16, at);
        const LobeNumbers numbers = load_numbers<shape, aniso, fresnel>(
            lobe, [&](const std::vector<float>& values) { return hn::Set(d, values[at]); });
        const VF nx = hn::Set(d, tile.normal_x[at]), ny = hn::Set(d, tile.normal_y[at]),
                 nz = hn::Set(d, tile.normal_z[at]);
        const VF x = hn::Set(d, wx[r]), y = hn::Set(d, wy[r]), z = hn::Set(d, wz[r]);
        Factors own = factors_of<shape, aniso>(numbers, dot(nx, ny, nz, x, y, z), x, y, z);
        if constexpr (shape == Shape::coat_base) own.s = coat_factors(lobe, same_slots, own.z);
        for (size_t c = 0; c < padded; c += lanes) {
            const VF dx = hn::LoadU(d, &directions.x[c]), dy = hn::LoadU(d, &directions.y[c]),
                     dz = hn::LoadU(d, &directions.z[c]);
            Factors other = factors_of<shape, aniso>(numbers, dot(nx, ny, nz, dx, dy, dz), dx, dy, dz);
            if constexpr (shape == Shape::coat_base) other.s = coat_factors(lobe, same_slots, other.z);
            // From |a + b|: 1 + <a, b> would cancel where they are nearly opposite.
            const VF sx = hn::Add(x, dx), sy = hn::Add(y, dy), sz = hn::Add(z, dz),
                     length2 = hn::Max(dot(sx, sy, sz, sx, sy, sz), hn::Set(d, 1e-12f));
            const VF cos_ab = hn::MulSub(length2, hn::Set(d, 0.5f), hn::Set(d, 1.0f));
            const VF value =
                lobe_value<shape, aniso, fresnel>(numbers, own, other, cos_ab, reciprocal_sqrt(length2));
            hn::StoreU(hn::Add(hn::LoadU(d, out + c), value), d, out + c);
        }
    }
}

// Calls visit.template operator()<shape, aniso, fresnel>().
template <class Visit>
HWY_INLINE void with_lobe(const SlotLobe& lobe, Visit&& visit) {
    auto microfacet = [&]<Shape shape>() {
        if (lobe.anisotropic)
            lobe.fresnel ? visit.template operator()<shape, true, true>()
                         : visit.template operator()<shape, true, false>();
        else
            lobe.fresnel ? visit.template operator()<shape, false, true>()
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

void rows(const SlotMaterial& material, const Tile& tile, size_t n_rows, const uint32_t* slot,
          const float* wx, const float* wy, const float* wz, const DirectionArrays& directions, float* out) {
    const size_t padded = directions.x.size();
    for (size_t r = 0; r < n_rows; ++r) std::fill_n(out + r * padded, padded, material.lambert[slot[r]]);
    for (const SlotLobe& lobe : material.lobes)
        with_lobe(lobe, [&]<Shape shape, bool aniso, bool fresnel>() {
            rows_of_lobe<shape, aniso, fresnel>(lobe, tile, n_rows, slot, wx, wy, wz, directions, out);
        });
}

void combine(const float* weights, size_t n, const float* rows_of, size_t columns, float* out, float* total) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    for (size_t c = 0; c < columns; c += lanes) {
        VF sum = hn::Zero(d);
        for (size_t t = 0; t < n; ++t)
            sum = hn::MulAdd(hn::Set(d, weights[t]), hn::LoadU(d, rows_of + t * columns + c), sum);
        hn::StoreU(sum, d, out + c);
        if (total) hn::StoreU(hn::Add(sum, hn::LoadU(d, total + c)), d, total + c);
    }
}

// Factors of all directions for a stretch of slots: [direction][z, s, x, y as needed][direct_chunk].
template <Shape shape, bool aniso>
size_t fill_factors(const SlotLobe* lobe, const Tile& tile, const DirectSlots& slots,
                    const DirectionArrays& directions, std::vector<float>& factors) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    const size_t n_factors = !lobe ? 1 : aniso ? 4 : 2, size = n_factors * direct_chunk;
    factors.resize(directions.n * size);
    for (size_t k = 0; k < slots.count; k += lanes) {
        const size_t at = slots.first + k;
        size_t own_slots[16];
        for (size_t lane = 0; lane < 16; ++lane) own_slots[lane] = at + std::min(lane, lanes - 1);
        LobeNumbers numbers;
        if (lobe)
            numbers = load_numbers<shape, aniso, false>(
                *lobe, [&](const std::vector<float>& values) { return hn::LoadU(d, &values[at]); });
        const VF nx = hn::LoadU(d, &tile.normal_x[at]), ny = hn::LoadU(d, &tile.normal_y[at]),
                 nz = hn::LoadU(d, &tile.normal_z[at]);
        for (int c = 0; c < directions.n; ++c) {
            const VF dx = hn::Set(d, directions.x[c]), dy = hn::Set(d, directions.y[c]),
                     dz = hn::Set(d, directions.z[c]);
            float* to = &factors[c * size + k];
            const VF z = dot(nx, ny, nz, dx, dy, dz);
            if (!lobe) {
                hn::StoreU(hn::Max(z, hn::Zero(d)), d, to);
                continue;
            }
            Factors f = factors_of<shape, aniso>(numbers, z, dx, dy, dz);
            if constexpr (shape == Shape::coat_base) f.s = coat_factors(*lobe, own_slots, f.z);
            hn::StoreU(f.z, d, to);
            hn::StoreU(f.s, d, to + direct_chunk);
            if constexpr (aniso) {
                hn::StoreU(f.x, d, to + 2 * direct_chunk);
                hn::StoreU(f.y, d, to + 3 * direct_chunk);
            }
        }
    }
    return size;
}

// lambert: null if another lobe carries it.
template <Shape shape, bool aniso, bool fresnel>
void direct_of_lobe(const SlotLobe* lobe, const float* lambert, const Tile& tile, const DirectSlots& slots,
                    const DirectionArrays& lights, const DirectionArrays& views, bool same,
                    DirectScratch& scratch, double* sums) {
    const D d;
    const DU du;
    const size_t lanes = hn::Lanes(d);
    const size_t size = fill_factors<shape, aniso>(lobe, tile, slots, lights, scratch.light_factors);
    if (!same) fill_factors<shape, aniso>(lobe, tile, slots, views, scratch.view_factors);
    const float* light_factors = scratch.light_factors.data();
    const float* view_factors = same ? light_factors : scratch.view_factors.data();
    for (int l = 0; l < lights.n; ++l)
        for (int v = same ? l : 0; v < views.n; ++v) {
            const double x = static_cast<double>(lights.x[l]) + views.x[v],
                         y = static_cast<double>(lights.y[l]) + views.y[v],
                         z = static_cast<double>(lights.z[l]) + views.z[v],
                         length2 = std::max(x * x + y * y + z * z, 1e-12);
            const VF cos_ab = hn::Set(d, static_cast<float>(length2 / 2 - 1)),
                     inverse = hn::Set(d, static_cast<float>(1 / std::sqrt(length2)));
            const float *fl = light_factors + l * size, *fv = view_factors + v * size;
            const uint32_t *bl = slots.light_bits + l * slots.light_stride,
                           *bv = slots.view_bits + v * slots.view_stride;
            VF sum = hn::Zero(d);
            for (size_t k = 0; k < slots.count; k += lanes) {
                const auto both = hn::And(hn::LoadU(du, bl + k), hn::LoadU(du, bv + k));
                const VF count =
                    hn::ConvertTo(d, hn::BitCast(hn::RebindToSigned<D>(), hn::PopulationCount(both)));
                const size_t at = slots.first + k;
                const VF za = hn::LoadU(d, fl + k), zb = hn::LoadU(d, fv + k);
                const VF lit = hn::Mul(hn::Mul(za, zb), hn::Mul(count, hn::LoadU(d, slots.area + at)));
                VF f = lambert ? hn::LoadU(d, lambert + at) : hn::Zero(d);
                if (lobe) {
                    const LobeNumbers numbers = load_numbers<shape, aniso, fresnel>(
                        *lobe, [&](const std::vector<float>& values) { return hn::LoadU(d, &values[at]); });
                    Factors a, b;
                    a.z = za, b.z = zb;
                    a.s = hn::LoadU(d, fl + direct_chunk + k), b.s = hn::LoadU(d, fv + direct_chunk + k);
                    a.x = a.y = b.x = b.y = hn::Zero(d);
                    if constexpr (aniso) {
                        a.x = hn::LoadU(d, fl + 2 * direct_chunk + k);
                        b.x = hn::LoadU(d, fv + 2 * direct_chunk + k);
                        a.y = hn::LoadU(d, fl + 3 * direct_chunk + k);
                        b.y = hn::LoadU(d, fv + 3 * direct_chunk + k);
                    }
                    f = hn::Add(f, lobe_value<shape, aniso, fresnel>(numbers, a, b, cos_ab, inverse));
                }
                sum = hn::MulAdd(lit, f, sum);
            }
            sums[static_cast<size_t>(l) * views.n + v] += hn::GetLane(hn::SumOfLanes(d, sum));
        }
}

void direct(const SlotMaterial& material, const Tile& tile, const DirectSlots& slots,
            const DirectionArrays& lights, const DirectionArrays& views, bool same, DirectScratch& scratch,
            double* sums) {
    const float* lambert = material.lambert.data();
    if (material.lobes.empty())
        direct_of_lobe<Shape::blinn_phong, false, false>(nullptr, lambert, tile, slots, lights, views, same,
                                                         scratch, sums);
    for (const SlotLobe& lobe : material.lobes) {
        with_lobe(lobe, [&]<Shape shape, bool aniso, bool fresnel>() {
            direct_of_lobe<shape, aniso, fresnel>(&lobe, lambert, tile, slots, lights, views, same, scratch,
                                                  sums);
        });
        lambert = nullptr;
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
HWY_EXPORT(rows);
HWY_EXPORT(direct);
HWY_EXPORT(combine);

DirectionArrays::DirectionArrays(const std::vector<Vec3>& directions)
    : x((directions.size() + 15) / 16 * 16),
      y(x.size()),
      z(x.size()),
      n(static_cast<int>(directions.size())) {
    for (size_t k = 0; k < directions.size(); ++k) {
        x[k] = static_cast<float>(directions[k].x);
        y[k] = static_cast<float>(directions[k].y);
        z[k] = static_cast<float>(directions[k].z);
    }
}

void lobe_rows(const SlotMaterial& material, const Tile& tile, size_t n_rows, const uint32_t* slot,
               const float* wx, const float* wy, const float* wz, const DirectionArrays& directions,
               float* out) {
    HWY_DYNAMIC_DISPATCH(rows)(material, tile, n_rows, slot, wx, wy, wz, directions, out);
}

void combine_rows(const float* weights, size_t n, const float* rows_of, size_t columns, float* out,
                  float* total) {
    HWY_DYNAMIC_DISPATCH(combine)(weights, n, rows_of, columns, out, total);
}

void add_direct_sums(const SlotMaterial& material, const Tile& tile, const DirectSlots& slots,
                     const DirectionArrays& lights, const DirectionArrays& views, bool same,
                     DirectScratch& scratch, double* sums) {
    HWY_DYNAMIC_DISPATCH(direct)(material, tile, slots, lights, views, same, scratch, sums);
}
}  // namespace gonio
#endif  // HWY_ONCE
