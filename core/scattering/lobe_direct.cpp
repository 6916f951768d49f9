// Lobes of many facets for pairs of light and view.
// VPOPCNTDQ, where there is one.
#define HWY_WANT_AVX3_DL
#include <algorithm>
#include <cmath>

#include "scattering/lobe_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scattering/lobe_direct.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "scattering/lobe_shapes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {

// What the loop over pairs of directions reads of one of them, [which][direct_chunk].
enum Column { cosine, seen, shape_s, shape_x, shape_y };
template <Shape shape, bool aniso>
constexpr size_t n_columns(bool lobe) {
    return !lobe ? 2 : aniso ? 5 : 3;
}

// Columns of all directions for a stretch of slots. Of a single sub-sample the cosine is 0 where the facet is
// not seen, and `seen` is a mask: then no pair has to look at bits.
template <Shape shape, bool aniso>
void fill_columns(const SlotLobe* lobe, const Tile& tile, const DirectSlots& slots, const uint32_t* bits,
                  const DirectionArrays& directions, std::vector<float>& columns) {
    const D d;
    const DU du;
    const size_t lanes = hn::Lanes(d), size = n_columns<shape, aniso>(lobe) * direct_chunk;
    const bool single = slots.n_sub_samples == 1;
    columns.resize(directions.n * size);
    for (size_t k = 0; k < slots.count; k += lanes) {
        const size_t at = slots.first + k;
        LobeNumbers numbers;
        if (lobe)
            numbers = load_numbers<shape, aniso, false>(
                *lobe, [&](const std::vector<float>& values) { return hn::LoadU(d, &values[at]); });
        const VF nx = hn::LoadU(d, &tile.normal_x[at]), ny = hn::LoadU(d, &tile.normal_y[at]),
                 nz = hn::LoadU(d, &tile.normal_z[at]);
        for (int c = 0; c < directions.n; ++c) {
            const VF dx = hn::Set(d, directions.x[c]), dy = hn::Set(d, directions.y[c]),
                     dz = hn::Set(d, directions.z[c]);
            float* to = &columns[c * size + k];
            const VF z = dot(nx, ny, nz, dx, dy, dz);
            const auto none = hn::Eq(hn::LoadU(du, bits + c * direct_chunk + k), hn::Zero(du));
            const VF mask = hn::BitCast(d, hn::Not(hn::VecFromMask(du, none)));
            Factors f;
            f.z = hn::Max(z, hn::Zero(d));
            if (lobe) {
                f = factors_of<shape, aniso>(numbers, z, dx, dy, dz);
                hn::StoreU(is_microfacet(shape) ? hn::Div(f.s, f.z) : f.s, d, to + shape_s * direct_chunk);
                if constexpr (aniso) {
                    hn::StoreU(f.x, d, to + shape_x * direct_chunk);
                    hn::StoreU(f.y, d, to + shape_y * direct_chunk);
                }
            }
            hn::StoreU(single ? hn::And(f.z, mask) : f.z, d, to + cosine * direct_chunk);
            hn::StoreU(mask, d, to + seen * direct_chunk);
        }
    }
}

// Views that are worked on side by side: they share what is loaded of light and facet.
constexpr int abreast = 4;

// lambert: null if another lobe carries it. single: of one sub-sample.
template <Shape shape, bool aniso, bool fresnel, bool single>
void direct_of_lobe(const SlotLobe* lobe, const float* lambert, const Tile& tile, const DirectSlots& slots,
                    const DirectionArrays& lights, const DirectionArrays& views, bool same,
                    DirectScratch& scratch, double* sums) {
    const D d;
    const DU du;
    const DI di;
    const size_t lanes = hn::Lanes(d), size = n_columns<shape, aniso>(lobe) * direct_chunk;
    const uint32_t* light_bits = scratch.light_bits.data();
    const uint32_t* view_bits = same ? light_bits : scratch.view_bits.data();
    fill_columns<shape, aniso>(lobe, tile, slots, light_bits, lights, scratch.light_columns);
    if (!same) fill_columns<shape, aniso>(lobe, tile, slots, view_bits, views, scratch.view_columns);
    const float* light_columns = scratch.light_columns.data();
    const float* view_columns = same ? light_columns : scratch.view_columns.data();
    auto column = [&](const float* of, Column which, size_t k)
                      HWY_ATTR { return hn::LoadU(d, of + which * direct_chunk + k); };
    auto factors_at = [&](const float* of, size_t k) HWY_ATTR {
        Factors f;
        f.z = column(of, cosine, k);
        f.s = column(of, shape_s, k);
        f.x = f.y = hn::Zero(d);
        if constexpr (aniso) f.x = column(of, shape_x, k), f.y = column(of, shape_y, k);
        return f;
    };
    for (int l = 0; l < lights.n; ++l)
        for (int first = same ? l : 0; first < views.n; first += abreast) {
            const float *of_light = light_columns + l * size, *of_view[abreast];
            const uint32_t *lit = light_bits + l * direct_chunk, *visible[abreast];
            VF cos_ab[abreast], inverse2[abreast], glossy[abreast], diffuse[abreast];
            for (int q = 0; q < abreast; ++q) {
                const int v = std::min(first + q, views.n - 1);  // beyond the last: computed in vain
                const size_t pair = static_cast<size_t>(l) * views.n + v;
                cos_ab[q] = hn::Set(d, scratch.cos_ab[pair]);
                inverse2[q] = hn::Set(d, scratch.inverse2[pair]);
                of_view[q] = view_columns + v * size;
                visible[q] = view_bits + v * direct_chunk;
                glossy[q] = diffuse[q] = hn::Zero(d);
            }
            for (size_t k = 0; k < slots.count; k += lanes) {
                const size_t at = slots.first + k;
                const VF za = column(of_light, cosine, k), area = hn::LoadU(d, slots.area + at);
                const VF flat =
                    lambert ? hn::Mul(hn::Mul(area, za), hn::LoadU(d, lambert + at)) : hn::Zero(d);
                VF strength = hn::Zero(d);
                LobeNumbers numbers;
                Factors a;
                if (lobe) {
                    numbers = load_numbers<shape, aniso, fresnel>(
                        *lobe, [&](const std::vector<float>& values) { return hn::LoadU(d, &values[at]); });
                    a = factors_at(of_light, k);
                    strength = hn::Mul(area, numbers.weight);
                    if constexpr (!is_microfacet(shape))
                        strength = hn::Mul(strength, za);
                    else if constexpr (single)
                        strength = hn::And(strength, column(of_light, seen, k));
                }
                for (int q = 0; q < abreast; ++q) {
                    VF zb = column(of_view[q], cosine, k), visible_strength = strength;
                    if constexpr (!single) {
                        const auto both = hn::And(hn::LoadU(du, lit + k), hn::LoadU(du, visible[q] + k));
                        const VF count = hn::ConvertTo(d, hn::BitCast(di, hn::PopulationCount(both)));
                        zb = hn::Mul(zb, count);
                        visible_strength = hn::Mul(strength, count);
                    }
                    diffuse[q] = hn::MulAdd(flat, zb, diffuse[q]);
                    if (!lobe) continue;
                    const Factors b = factors_at(of_view[q], k);
                    if constexpr (is_microfacet(shape)) {
                        if constexpr (single)
                            visible_strength = hn::And(strength, column(of_view[q], seen, k));
                        const VF value = microfacet_value<shape, aniso, fresnel>(
                            numbers, hn::Add(a.z, b.z), hn::Add(a.x, b.x), hn::Add(a.y, b.y),
                            hn::Add(a.s, b.s), cos_ab[q], inverse2[q]);
                        glossy[q] = hn::MulAdd(visible_strength, value, glossy[q]);
                    } else {
                        const VF value =
                            lobe_value<shape, aniso, fresnel>(numbers, a, b, cos_ab[q], inverse2[q]);
                        glossy[q] = hn::MulAdd(hn::Mul(strength, zb), value, glossy[q]);
                    }
                }
            }
            for (int q = 0; q < std::min(abreast, views.n - first); ++q) {
                if (lobe && lobe->same_index)
                    glossy[q] = hn::Mul(
                        glossy[q], fresnel_factor(cos_2_to_half(cos_ab[q]), hn::Set(d, lobe->same_index->eta),
                                                  hn::Set(d, lobe->same_index->k)));
                sums[static_cast<size_t>(l) * views.n + first + q] +=
                    hn::GetLane(hn::SumOfLanes(d, hn::Add(glossy[q], diffuse[q])));
            }
        }
}

// The bits of a stretch side by side: rows of all directions, a power of two apart, share few cache sets.
void gather_bits(const uint32_t* bits, size_t stride, int n, size_t count, std::vector<uint32_t>& gathered) {
    gathered.resize(n * direct_chunk);
    for (int c = 0; c < n; ++c) std::copy_n(bits + c * stride, count, &gathered[c * direct_chunk]);
}

void direct(const SlotMaterial& material, const Tile& tile, const DirectSlots& slots,
            const DirectionArrays& lights, const DirectionArrays& views, bool same, DirectScratch& scratch,
            double* sums) {
    gather_bits(slots.light_bits, slots.light_stride, lights.n, slots.count, scratch.light_bits);
    if (!same) gather_bits(slots.view_bits, slots.view_stride, views.n, slots.count, scratch.view_bits);
    const float* lambert = material.lambert.data();
    auto add = [&]<Shape shape, bool aniso, bool fresnel>(const SlotLobe* lobe) {
        if (slots.n_sub_samples == 1)
            direct_of_lobe<shape, aniso, fresnel, true>(lobe, lambert, tile, slots, lights, views, same,
                                                        scratch, sums);
        else
            direct_of_lobe<shape, aniso, fresnel, false>(lobe, lambert, tile, slots, lights, views, same,
                                                         scratch, sums);
    };
    if (material.lobes.empty()) add.template operator()<Shape::blinn_phong, false, false>(nullptr);
    for (const SlotLobe& lobe : material.lobes) {
        with_lobe(lobe, lobe.fresnel && !lobe.same_index, [&]<Shape shape, bool aniso, bool fresnel>() {
            add.template operator()<shape, aniso, fresnel>(&lobe);
        });
        lambert = nullptr;
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
HWY_EXPORT(direct);

DirectScratch::DirectScratch(const DirectionArrays& lights, const DirectionArrays& views) {
    for (int l = 0; l < lights.n; ++l)
        for (int v = 0; v < views.n; ++v) {
            const double x = static_cast<double>(lights.x[l]) + views.x[v],
                         y = static_cast<double>(lights.y[l]) + views.y[v],
                         z = static_cast<double>(lights.z[l]) + views.z[v],
                         length2 = std::max(x * x + y * y + z * z, 1e-12);
            cos_ab.push_back(static_cast<float>(length2 / 2 - 1));
            inverse2.push_back(static_cast<float>(1 / length2));
        }
}

void add_direct_sums(const SlotMaterial& material, const Tile& tile, const DirectSlots& slots,
                     const DirectionArrays& lights, const DirectionArrays& views, bool same,
                     DirectScratch& scratch, double* sums) {
    HWY_DYNAMIC_DISPATCH(direct)(material, tile, slots, lights, views, same, scratch, sums);
}
}  // namespace gonio
#endif  // HWY_ONCE
