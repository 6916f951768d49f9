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
            const Factors f = factors_of<shape, aniso>(numbers, z, dx, dy, dz);
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

// Views that are worked on side by side: they share what is loaded of light and facet.
constexpr int abreast = 4;

// How many of the sub-samples' bits are set: of a single one, the bit itself.
HWY_INLINE VF bit_count(hn::Vec<DU> bits, bool single) {
    const auto count = single ? bits : hn::PopulationCount(bits);
    return hn::ConvertTo(D(), hn::BitCast(DI(), count));
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
    const uint32_t* light_bits = scratch.light_bits.data();
    const uint32_t* view_bits = same ? light_bits : scratch.view_bits.data();
    const bool single_bit = slots.n_sub_samples == 1;
    auto factors_at = [&](const float* of, size_t k, VF z) {
        Factors f;
        f.z = z;
        f.s = hn::LoadU(d, of + direct_chunk + k);
        f.x = f.y = hn::Zero(d);
        if constexpr (aniso) {
            f.x = hn::LoadU(d, of + 2 * direct_chunk + k);
            f.y = hn::LoadU(d, of + 3 * direct_chunk + k);
        }
        return f;
    };
    for (int l = 0; l < lights.n; ++l)
        for (int first = same ? l : 0; first < views.n; first += abreast) {
            const float *fl = light_factors + l * size, *fv[abreast];
            const uint32_t *bl = light_bits + l * direct_chunk, *bv[abreast];
            VF cos_ab[abreast], inverse[abreast], reflected[abreast], sum[abreast];
            for (int q = 0; q < abreast; ++q) {
                const int v = std::min(first + q, views.n - 1);  // beyond the last: computed in vain
                const size_t pair = static_cast<size_t>(l) * views.n + v;
                cos_ab[q] = hn::Set(d, scratch.cos_ab[pair]);
                inverse[q] = hn::Set(d, scratch.inverse[pair]);
                reflected[q] = hn::Set(d, 1.0f);
                if (lobe && lobe->same_index)
                    reflected[q] = fresnel_factor(cos_2_to_half(cos_ab[q]), hn::Set(d, lobe->same_index->eta),
                                                  hn::Set(d, lobe->same_index->k));
                fv[q] = view_factors + v * size;
                bv[q] = view_bits + v * direct_chunk;
                sum[q] = hn::Zero(d);
            }
            for (size_t k = 0; k < slots.count; k += lanes) {
                const size_t at = slots.first + k;
                const auto lit = hn::LoadU(du, bl + k);
                const VF za = hn::LoadU(d, fl + k), area = hn::Mul(za, hn::LoadU(d, slots.area + at)),
                         diffuse = lambert ? hn::LoadU(d, lambert + at) : hn::Zero(d);
                LobeNumbers numbers;
                Factors a;
                if (lobe) {
                    numbers = load_numbers<shape, aniso, fresnel>(
                        *lobe, [&](const std::vector<float>& values) { return hn::LoadU(d, &values[at]); });
                    a = factors_at(fl, k, za);
                }
                for (int q = 0; q < abreast; ++q) {
                    const VF count = bit_count(hn::And(lit, hn::LoadU(du, bv[q] + k)), single_bit),
                             zb = hn::LoadU(d, fv[q] + k);
                    VF f = diffuse;
                    if (lobe)
                        f = hn::MulAdd(lobe_value<shape, aniso, fresnel>(numbers, a, factors_at(fv[q], k, zb),
                                                                         cos_ab[q], inverse[q]),
                                       reflected[q], f);
                    sum[q] = hn::MulAdd(hn::Mul(hn::Mul(area, zb), count), f, sum[q]);
                }
            }
            for (int q = 0; q < std::min(abreast, views.n - first); ++q)
                sums[static_cast<size_t>(l) * views.n + first + q] += hn::GetLane(hn::SumOfLanes(d, sum[q]));
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
    if (material.lobes.empty())
        direct_of_lobe<Shape::blinn_phong, false, false>(nullptr, lambert, tile, slots, lights, views, same,
                                                         scratch, sums);
    for (const SlotLobe& lobe : material.lobes) {
        with_lobe(lobe, lobe.fresnel && !lobe.same_index, [&]<Shape shape, bool aniso, bool fresnel>() {
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
HWY_EXPORT(direct);

DirectScratch::DirectScratch(const DirectionArrays& lights, const DirectionArrays& views) {
    for (int l = 0; l < lights.n; ++l)
        for (int v = 0; v < views.n; ++v) {
            const double x = static_cast<double>(lights.x[l]) + views.x[v],
                         y = static_cast<double>(lights.y[l]) + views.y[v],
                         z = static_cast<double>(lights.z[l]) + views.z[v],
                         length2 = std::max(x * x + y * y + z * z, 1e-12);
            cos_ab.push_back(static_cast<float>(length2 / 2 - 1));
            inverse.push_back(static_cast<float>(1 / std::sqrt(length2)));
        }
}

void add_direct_sums(const SlotMaterial& material, const Tile& tile, const DirectSlots& slots,
                     const DirectionArrays& lights, const DirectionArrays& views, bool same,
                     DirectScratch& scratch, double* sums) {
    HWY_DYNAMIC_DISPATCH(direct)(material, tile, slots, lights, views, same, scratch, sums);
}
}  // namespace gonio
#endif  // HWY_ONCE
