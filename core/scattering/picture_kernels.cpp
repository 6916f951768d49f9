#include "scattering/picture_kernels.h"

#include <algorithm>

#include "base/half.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scattering/picture_kernels.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;

// Columns that go through together: a block, or as much of it as four registers hold.
constexpr size_t columns_together() {
    return std::min<size_t>(32, 4 * hn::MaxLanes(D()));
}

HWY_INLINE void prefetch_row(const float* row) {
    hwy::Prefetch(row);
    hwy::Prefetch(row + 16);
}

void gather_rows(const uint32_t* begin, const Link* links, size_t first, size_t count, const float* x,
                 float* y, size_t n_sums, const float* factors, float* const* sums) {
    const D d;
    constexpr size_t together = columns_together(), lanes = hn::MaxLanes(D()), n = together / lanes;
    constexpr uint32_t ahead = 24;  // links
    const uint32_t last = begin[first + count];
    for (uint32_t k = begin[first]; k < std::min(last, begin[first] + ahead); ++k)
        prefetch_row(x + static_cast<size_t>(links[k].seen) * 32);
    for (size_t u = first; u < first + count; ++u)
        for (size_t c = 0; c < 32; c += together) {
            V sum[n];
            for (size_t v = 0; v < n; ++v) sum[v] = hn::Zero(d);
            for (uint32_t k = begin[u]; k < begin[u + 1]; ++k) {
                if (c == 0 && k + ahead < last)
                    prefetch_row(x + static_cast<size_t>(links[k + ahead].seen) * 32);
                const float* row = x + static_cast<size_t>(links[k].seen) * 32 + c;
                const V w = hn::Set(d, links[k].weight);
                for (size_t v = 0; v < n; ++v) sum[v] = hn::MulAdd(w, hn::LoadU(d, row + v * lanes), sum[v]);
            }
            const size_t at = u * 32 + c;
            for (size_t v = 0; v < n; ++v) hn::StoreU(sum[v], d, y + at + v * lanes);
            for (size_t s = 0; s < n_sums; ++s) {
                const V factor = hn::Set(d, factors[s]);
                for (size_t v = 0; v < n; ++v) {
                    float* to = sums[s] + at + v * lanes;
                    hn::StoreU(hn::MulAdd(factor, sum[v], hn::LoadU(d, to)), d, to);
                }
            }
        }
}

void rows_sum(const float* rows, const uint32_t* at, size_t n_rows, float* total) {
    const D d;
    constexpr size_t together = columns_together(), lanes = hn::MaxLanes(D()), n = together / lanes;
    constexpr size_t ahead = 24;
    for (size_t c = 0; c < 32; c += together) {
        V sum[n];
        for (size_t v = 0; v < n; ++v) sum[v] = hn::LoadU(d, total + c + v * lanes);
        for (size_t i = 0; i < n_rows; ++i) {
            if (c == 0 && i + ahead < n_rows) prefetch_row(rows + static_cast<size_t>(at[i + ahead]) * 32);
            const float* row = rows + static_cast<size_t>(at[i]) * 32 + c;
            for (size_t v = 0; v < n; ++v) sum[v] = hn::Add(sum[v], hn::LoadU(d, row + v * lanes));
        }
        for (size_t v = 0; v < n; ++v) hn::StoreU(sum[v], d, total + c + v * lanes);
    }
}

void planes_of_rows(const float* rows, size_t n_rows, int n_columns, const float* scale,
                    uint16_t* const* planes) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    constexpr size_t square = 32;
    uint16_t halves[square][32];
    float scaled[32];
    for (size_t first = 0; first < n_rows; first += square) {
        const size_t count = std::min(square, n_rows - first);
        for (size_t r = 0; r < count; ++r) {
            const float* row = rows + (first + r) * 32;
            for (size_t c = 0; c < 32; c += lanes) {
                const V value = hn::Mul(hn::LoadU(d, row + c), hn::LoadU(d, scale + c));
#if HWY_TARGET <= HWY_AVX2  // has the instruction; the others' stand-in does not round
                const hn::Rebind<hwy::float16_t, D> half;
                hn::StoreU(hn::DemoteTo(half, value), half, reinterpret_cast<hwy::float16_t*>(&halves[r][c]));
#else
                hn::StoreU(value, d, scaled + c);
#endif
            }
            if (HWY_TARGET > HWY_AVX2)
                for (size_t c = 0; c < 32; ++c) halves[r][c] = half_bits(scaled[c]);
        }
        for (int c = 0; c < n_columns; ++c)
            for (size_t r = 0; r < count; ++r) planes[c][first + r] = halves[r][c];
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
namespace {

HWY_EXPORT(gather_rows);
HWY_EXPORT(rows_sum);
HWY_EXPORT(planes_of_rows);

}  // namespace

void gather_links(const uint32_t* begin, const Link* links, size_t first, size_t count, const float* x,
                  float* y, size_t n_sums, const float* factors, float* const* sums) {
    HWY_DYNAMIC_DISPATCH(gather_rows)(begin, links, first, count, x, y, n_sums, factors, sums);
}

void add_rows(const float* rows, const uint32_t* at, size_t n, float* sum) {
    HWY_DYNAMIC_DISPATCH(rows_sum)(rows, at, n, sum);
}

float sum_at(const float* values, const uint32_t* at, size_t n) {
    float sums[4] = {};  // gather instructions are no faster
    size_t i = 0;
    for (; i + 4 <= n; i += 4)
        for (size_t k = 0; k < 4; ++k) sums[k] += values[at[i + k]];
    for (; i < n; ++i) sums[0] += values[at[i]];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

void half_planes(const float* rows, size_t n_rows, int n_columns, const float* scale,
                 uint16_t* const* planes) {
    HWY_DYNAMIC_DISPATCH(planes_of_rows)(rows, n_rows, n_columns, scale, planes);
}

}  // namespace gonio
#endif  // HWY_ONCE
