// Lobes of one facet toward many directions.
#include <algorithm>
#include <cmath>

#include "scattering/lobe_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scattering/lobe_rows.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "scattering/lobe_shapes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {

template <Shape shape, bool aniso, bool fresnel>
void rows_of_lobe(const SlotLobe& lobe, const Tile& tile, size_t n_rows, const uint32_t* slot,
                  const float* wx, const float* wy, const float* wz, const DirectionArrays& directions,
                  float* out) {
    const D d;
    const size_t lanes = hn::Lanes(d), padded = directions.x.size();
    for (size_t r = 0; r < n_rows; ++r, out += padded) {
        const size_t at = slot[r];
        const LobeNumbers numbers = load_numbers<shape, aniso, fresnel>(
            lobe, [&](const std::vector<float>& values) { return hn::Set(d, values[at]); });
        const VF nx = hn::Set(d, tile.normal_x[at]), ny = hn::Set(d, tile.normal_y[at]),
                 nz = hn::Set(d, tile.normal_z[at]);
        const VF x = hn::Set(d, wx[r]), y = hn::Set(d, wy[r]), z = hn::Set(d, wz[r]);
        const Factors own = factors_of<shape, aniso>(numbers, dot(nx, ny, nz, x, y, z), x, y, z);
        for (size_t c = 0; c < padded; c += lanes) {
            const VF dx = hn::LoadU(d, &directions.x[c]), dy = hn::LoadU(d, &directions.y[c]),
                     dz = hn::LoadU(d, &directions.z[c]);
            const Factors other = factors_of<shape, aniso>(numbers, dot(nx, ny, nz, dx, dy, dz), dx, dy, dz);
            // From |a + b|: 1 + <a, b> would cancel where they are nearly opposite.
            const VF sx = hn::Add(x, dx), sy = hn::Add(y, dy), sz = hn::Add(z, dz),
                     length2 = hn::Max(dot(sx, sy, sz, sx, sy, sz), hn::Set(d, 1e-12f));
            const VF cos_ab = hn::MulSub(length2, hn::Set(d, 0.5f), hn::Set(d, 1.0f));
            const VF value =
                lobe_value<shape, aniso, fresnel>(numbers, own, other, cos_ab, reciprocal(length2));
            hn::StoreU(hn::MulAdd(numbers.weight, value, hn::LoadU(d, out + c)), d, out + c);
        }
    }
}

void rows(const SlotMaterial& material, const Tile& tile, size_t n_rows, const uint32_t* slot,
          const float* wx, const float* wy, const float* wz, const DirectionArrays& directions, float* out) {
    const size_t padded = directions.x.size();
    for (size_t r = 0; r < n_rows; ++r) std::fill_n(out + r * padded, padded, material.lambert[slot[r]]);
    for (const SlotLobe& lobe : material.lobes)
        with_lobe(lobe, lobe.fresnel, [&]<Shape shape, bool aniso, bool fresnel>() {
            rows_of_lobe<shape, aniso, fresnel>(lobe, tile, n_rows, slot, wx, wy, wz, directions, out);
        });
}

// n_vectors of the columns from `first` on; each is a chain of its own, so that none waits for another.
template <int n_vectors>
HWY_INLINE void combine_some(const float* weights, size_t n, const float* rows_of, size_t columns,
                             size_t first, float* out, float* total) {
    const D d;
    const size_t lanes = hn::Lanes(d);
    VF sum[n_vectors];
    for (VF& s : sum) s = hn::Zero(d);
    for (size_t t = 0; t < n; ++t) {
        const VF weight = hn::Set(d, weights[t]);
        const float* row = rows_of + t * columns + first;
        for (int k = 0; k < n_vectors; ++k)
            sum[k] = hn::MulAdd(weight, hn::LoadU(d, row + k * lanes), sum[k]);
    }
    for (int k = 0; k < n_vectors; ++k) {
        const size_t c = first + k * lanes;
        hn::StoreU(sum[k], d, out + c);
        if (total) hn::StoreU(hn::Add(sum[k], hn::LoadU(d, total + c)), d, total + c);
    }
}

void combine(const float* weights, size_t n, const float* rows_of, size_t columns, float* out, float* total) {
    const size_t lanes = hn::Lanes(D());
    size_t c = 0;
    for (; c + 4 * lanes <= columns; c += 4 * lanes)
        combine_some<4>(weights, n, rows_of, columns, c, out, total);
    for (; c < columns; c += lanes) combine_some<1>(weights, n, rows_of, columns, c, out, total);
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
HWY_EXPORT(rows);
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
}  // namespace gonio
#endif  // HWY_ONCE
