#include "scattering/kernels.h"

#include <cstring>

#include "base/bits.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scattering/kernels.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;

void expand(const DirectionBlock& directions, const uint32_t* bits, size_t bits_stride, size_t first,
            size_t count, const float* normal_x, const float* normal_y, const float* normal_z,
            const float* sqrt_area, float* out) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    uint32_t square[32];
    for (size_t base = first; base < first + count; base += 32) {
        for (int c = 0; c < 32; ++c) square[c] = bits[c * bits_stride + base / 32];
        transpose_bits(square);  // now one word a slot, one bit a direction
        for (size_t s = 0; s < 32; ++s) {
            const size_t slot = base + s;
            const float area = sqrt_area[slot];
            const auto nx = hn::Set(d, normal_x[slot] * area), ny = hn::Set(d, normal_y[slot] * area),
                       nz = hn::Set(d, normal_z[slot] * area);
            float* to = out + slot * 32;
            for (size_t c = 0; c < 32; c += lanes) {
                uint8_t mask_bytes[8] = {};
                const uint32_t part = square[s] >> c;
                std::memcpy(mask_bytes, &part, 4);
                const auto cosine = hn::MulAdd(nx, hn::LoadU(d, directions.x + c),
                                               hn::MulAdd(ny, hn::LoadU(d, directions.y + c),
                                                          hn::Mul(nz, hn::LoadU(d, directions.z + c))));
                const auto lit =
                    hn::IfThenElseZero(hn::LoadMaskBits(d, mask_bytes), hn::Max(cosine, hn::Zero(d)));
                hn::StoreU(lit, d, to + c);
            }
        }
    }
}

void links_loop(const LinkRecord* records, size_t n_records, const Link* links, const float* x, float* y) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    // The columns of a block go through in halves of 16, so that even 4-lane vectors keep everything in
    // registers.
    for (size_t r = 0; r < n_records; ++r) {
        const float* x_p = x + static_cast<size_t>(records[r].unknown) * 32;
        float* y_p = y + static_cast<size_t>(records[r].unknown) * 32;
        const uint32_t begin = records[r].begin, end = records[r + 1].begin;
        if (r + 1 < n_records)
            for (uint32_t k = end; k < records[r + 2].begin; ++k) {
                const size_t at = static_cast<size_t>(links[k].seen) * 32;
                hwy::Prefetch(x + at);
                hwy::Prefetch(x + at + 16);
                hwy::Prefetch(y + at);
                hwy::Prefetch(y + at + 16);
            }
        for (size_t c = 0; c < 32; c += 2 * lanes) {
            const auto own0 = hn::LoadU(d, x_p + c), own1 = hn::LoadU(d, x_p + c + lanes);
            auto sum0 = hn::Zero(d), sum1 = hn::Zero(d);
            for (uint32_t k = begin; k < end; ++k) {
                const size_t at = static_cast<size_t>(links[k].seen) * 32 + c;
                const auto w = hn::Set(d, links[k].weight);
                sum0 = hn::MulAdd(w, hn::LoadU(d, x + at), sum0);
                sum1 = hn::MulAdd(w, hn::LoadU(d, x + at + lanes), sum1);
                hn::StoreU(hn::MulAdd(w, own0, hn::LoadU(d, y + at)), d, y + at);
                hn::StoreU(hn::MulAdd(w, own1, hn::LoadU(d, y + at + lanes)), d, y + at + lanes);
            }
            hn::StoreU(hn::Add(sum0, hn::LoadU(d, y_p + c)), d, y_p + c);
            hn::StoreU(hn::Add(sum1, hn::LoadU(d, y_p + c + lanes)), d, y_p + c + lanes);
        }
    }
}

using V = hn::Vec<D>;

// Coefficients of c(t + a) where c has one variable, or of c(t0 + a, t1 + b).
template <int kCoefficients>
HWY_INLINE void shift(const V* c, V a, V b, V* to) {
    if constexpr (kCoefficients == 3) {
        to[0] = hn::MulAdd(a, hn::MulAdd(a, c[2], c[1]), c[0]);
        to[1] = hn::MulAdd(hn::Add(a, a), c[2], c[1]);
        to[2] = c[2];
    } else {
        to[0] = hn::MulAdd(a, hn::MulAdd(a, c[3], hn::MulAdd(b, c[4], c[1])),
                           hn::MulAdd(b, hn::MulAdd(b, c[5], c[2]), c[0]));
        to[1] = hn::MulAdd(hn::Add(a, a), c[3], hn::MulAdd(b, c[4], c[1]));
        to[2] = hn::MulAdd(hn::Add(b, b), c[5], hn::MulAdd(a, c[4], c[2]));
        to[3] = c[3], to[4] = c[4], to[5] = c[5];
    }
}

template <int kCoefficients>
void turned_links_loop(const LinkRecord* records, size_t n_records, const Link* links, const LinkTurn* turns,
                       int axis, const float* const* x, float* const* y) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    for (size_t r = 0; r < n_records; ++r)
        for (size_t c = 0; c < 32; c += lanes) {
            const size_t from = static_cast<size_t>(records[r].unknown) * 32 + c;
            V own[kCoefficients], sum[kCoefficients], seen[kCoefficients], shifted[kCoefficients];
            for (int m = 0; m < kCoefficients; ++m) {
                own[m] = hn::LoadU(d, x[m] + from);
                sum[m] = hn::Zero(d);
            }
            for (uint32_t k = records[r].begin; k < records[r + 1].begin; ++k) {
                const size_t at = static_cast<size_t>(links[k].seen) * 32 + c;
                const V w = hn::Set(d, links[k].weight), a = hn::Set(d, turns[k].about[axis]),
                        b = hn::Set(d, turns[k].about[1]);
                for (int m = 0; m < kCoefficients; ++m) seen[m] = hn::LoadU(d, x[m] + at);
                shift<kCoefficients>(seen, a, b, shifted);
                for (int m = 0; m < kCoefficients; ++m) sum[m] = hn::MulAdd(w, shifted[m], sum[m]);
                shift<kCoefficients>(own, hn::Neg(a), hn::Neg(b), shifted);
                for (int m = 0; m < kCoefficients; ++m)
                    hn::StoreU(hn::MulAdd(w, shifted[m], hn::LoadU(d, y[m] + at)), d, y[m] + at);
            }
            for (int m = 0; m < kCoefficients; ++m)
                hn::StoreU(hn::Add(sum[m], hn::LoadU(d, y[m] + from)), d, y[m] + from);
        }
}

void turned_links(const LinkRecord* records, size_t n_records, const Link* links, const LinkTurn* turns,
                  int n_coefficients, int axis, const float* const* x, float* const* y) {
    if (n_coefficients == 3)
        turned_links_loop<3>(records, n_records, links, turns, axis, x, y);
    else
        turned_links_loop<6>(records, n_records, links, turns, 0, x, y);
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
HWY_EXPORT(expand);
HWY_EXPORT(links_loop);
HWY_EXPORT(turned_links);

void expand_visible(const DirectionBlock& directions, const uint32_t* bits, size_t bits_stride, size_t first,
                    size_t count, const float* normal_x, const float* normal_y, const float* normal_z,
                    const float* sqrt_area, float* out) {
    HWY_DYNAMIC_DISPATCH(expand)
    (directions, bits, bits_stride, first, count, normal_x, normal_y, normal_z, sqrt_area, out);
}

void apply_links(const LinkRecord* records, size_t n_records, const Link* links, const float* x, float* y) {
    HWY_DYNAMIC_DISPATCH(links_loop)(records, n_records, links, x, y);
}

void apply_turned_links(const LinkRecord* records, size_t n_records, const Link* links, const LinkTurn* turns,
                        int n_coefficients, int axis, const float* const* x, float* const* y) {
    HWY_DYNAMIC_DISPATCH(turned_links)(records, n_records, links, turns, n_coefficients, axis, x, y);
}
}  // namespace gonio
#endif  // HWY_ONCE
