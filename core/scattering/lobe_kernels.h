// Lobes in batches, compiled for every instruction set and chosen at run time: over facets for the direct
// term, over directions for the pair graph.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "directions/direction.h"
#include "scattering/slot_material.h"
#include "scattering/tile.h"

namespace gonio {

// Directions as structure of arrays, padded with zeros to a multiple of 16.
struct DirectionArrays {
    std::vector<float> x, y, z;
    int n = 0;

    DirectionArrays() = default;
    explicit DirectionArrays(const std::vector<Vec3>& directions);
    int padded() const { return static_cast<int>(x.size()); }
};

// out[r * directions.padded() + c] = f(slot[r]; (wx, wy, wz)[r], directions[c]) in 1/sr. Both are taken to be
// above the facet; what is asked for below it is finite and means nothing.
void lobe_rows(const SlotMaterial& material, const Tile& tile, size_t n_rows, const uint32_t* slot,
               const float* wx, const float* wy, const float* wz, const DirectionArrays& directions,
               float* out);

// out[c] = sum over t < n of weights[t] rows[t * columns + c], columns a multiple of 16; added to `total`,
// too, if that is not null.
void combine_rows(const float* weights, size_t n, const float* rows, size_t columns, float* out,
                  float* total);

// One stretch of slots, at most direct_chunk of them, with visibility bits of lights and views.
inline constexpr size_t direct_chunk = 128;
struct DirectSlots {
    size_t first = 0, count = 0;  // slots; multiples of 32
    const float* area = nullptr;  // per slot of the tile; 0 where it is not measured
    int n_sub_samples = 32;
    // bits[direction * stride + slot - first]: one bit a sub-sample.
    const uint32_t *light_bits = nullptr, *view_bits = nullptr;
    size_t light_stride = 0, view_stride = 0;
};

// What one thread works with: room, and of each pair of light and view its cosine and 1 / |l + v|^2.
struct DirectScratch {
    std::vector<uint32_t> light_bits, view_bits;
    std::vector<float> light_columns, view_columns, cos_ab, inverse2;
    DirectScratch(const DirectionArrays& lights, const DirectionArrays& views);
};

// sums[l * views.n + v] += sum over the slots of area f(n; l, v) <n,l> <n,v> popcount(bits_l & bits_v); for
// v >= l alone if `same` (views are the lights).
void add_direct_sums(const SlotMaterial& material, const Tile& tile, const DirectSlots& slots,
                     const DirectionArrays& lights, const DirectionArrays& views, bool same,
                     DirectScratch& scratch, double* sums);

}  // namespace gonio
