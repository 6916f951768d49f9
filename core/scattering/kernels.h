// The two inner loops of the diffuse transport, compiled for every instruction set and chosen at run time.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gonio {

// 32 directions, structure of arrays; unused ones are 0 (and their visibility bits must be).
struct DirectionBlock {
    float x[32] = {}, y[32] = {}, z[32] = {};
};

// Irradiance factors of the facets at slots [first, first + count), count a multiple of 32, for one block of
// directions:
//   out[slot][c] = sqrt_area * max(0, <n, d_c>) * bit
// `bits[c * bits_stride + slot / 32]` holds direction c's visibility, bit slot % 32.
void expand_visible(const DirectionBlock& directions, const uint32_t* bits, size_t bits_stride, size_t first,
                    size_t count, const float* normal_x, const float* normal_y, const float* normal_z,
                    const float* sqrt_area, float* out);

// One link of the transport: an unknown that is seen, and the symmetric weight (K + K^T) / 2 in the
// area-scaled basis.
struct Link {
    uint32_t seen;
    float weight;
};
// The links of one unknown: links[begin, next record's begin).
struct LinkRecord {
    uint32_t unknown;
    uint32_t begin;
};

// y += K x for one block of 32 columns: for each link (p, q, w): y[p] += w x[q] and y[q] += w x[p].
// Self-adjoint by construction. records has one entry more than there are records: the end of the last.
void apply_links(const LinkRecord* records, size_t n_records, const Link* links, const float* x, float* y);

// On a curved base: how far the frame has turned from one end of a link to the other, radians about the two
// principal directions of the base.
struct LinkTurn {
    float about[2];
};

// Fields that are polynomials of second degree in the turn of the frame (turned_light.h): 3 coefficients (1,
// t, t^2) in one turn, the `axis`th, or 6 (1, t0, t1, t0^2, t0 t1, t1^2) in both. For each link (p, q, w, t):
// y[p] += w x[q] shifted by t, and y[q] += w x[p] shifted by -t. turns: parallel to links.
void apply_turned_links(const LinkRecord* records, size_t n_records, const Link* links, const LinkTurn* turns,
                        int n_coefficients, int axis, const float* const* x, float* const* y);

}  // namespace gonio
