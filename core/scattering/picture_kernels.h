// The inner loops of pictures: light gathered by facets, and what pixels make of it. Compiled for every
// instruction set and chosen at run time.
#pragma once
#include <cstddef>
#include <cstdint>

#include "scattering/kernels.h"

namespace gonio {

// For unknowns u in [first, first + count), of one block of 32 columns: y[u] = sum over links [begin[u],
// begin[u + 1]) of weight x[seen], and sums[s][u] += factors[s] y[u].
void gather_links(const uint32_t* begin, const Link* links, size_t first, size_t count, const float* x,
                  float* y, size_t n_sums, const float* factors, float* const* sums);

// sum[c] += sum over i < n of rows[at[i]][c], rows of 32 columns.
void add_rows(const float* rows, const uint32_t* at, size_t n, float* sum);
// Sum over i < n of values[at[i]].
float sum_at(const float* values, const uint32_t* at, size_t n);

// planes[c][r] = half of scale[c] * rows[r][c] for n_columns <= 32 of 32 columns: nearest, ties to even.
void half_planes(const float* rows, size_t n_rows, int n_columns, const float* scale,
                 uint16_t* const* planes);

}  // namespace gonio
