// Values per unknown for a batch of directions, and their inner products.
#pragma once
#include <cstddef>
#include <utility>
#include <vector>

#include "base/huge_pages.h"
#include "scattering/tile.h"

namespace gonio {

// Columns (one a light or view) are kept in blocks of 32: block b holds [unknown][32]. A block of one unknown
// is two cache lines, and the blocks that a gather touches stay in the second-level cache.
inline constexpr int column_block = 32;

// Values start uninitialised.
class Fields {
  public:
    Fields() = default;
    Fields(size_t n_unknowns, int n_columns)
        : n_unknowns_(n_unknowns),
          n_columns_(n_columns),
          values_(static_cast<size_t>((n_columns + column_block - 1) / column_block) * n_unknowns *
                  column_block) {}
    // values: as values() of such fields.
    Fields(size_t n_unknowns, int n_columns, HugeFloats values)
        : n_unknowns_(n_unknowns), n_columns_(n_columns), values_(std::move(values)) {}
    size_t n_unknowns() const { return n_unknowns_; }
    int n_columns() const { return n_columns_; }
    int n_blocks() const { return static_cast<int>(values_.size() / (n_unknowns_ * column_block)); }
    float* block(int b) { return values_.data() + static_cast<size_t>(b) * n_unknowns_ * column_block; }
    const float* block(int b) const {
        return values_.data() + static_cast<size_t>(b) * n_unknowns_ * column_block;
    }
    HugeFloats& values() { return values_; }
    const HugeFloats& values() const { return values_; }

  private:
    size_t n_unknowns_ = 0;
    int n_columns_ = 0;
    HugeFloats values_;
};

// A copy of the first block of columns.
Fields first_block(const Fields& fields);

// Row-major matrix of sums, in double.
struct Matrix {
    int rows = 0, columns = 0;
    std::vector<double> values;
    Matrix() = default;
    Matrix(int r, int c) : rows(r), columns(c), values(static_cast<size_t>(r) * c) {}
    double& operator()(int r, int c) { return values[static_cast<size_t>(r) * columns + c]; }
    double operator()(int r, int c) const { return values[static_cast<size_t>(r) * columns + c]; }
};

// A linear combination of fields, formed while it is packed for the product: no pass over memory of its own.
struct Term {
    const Fields* fields;
    double factor = 1;
};
using Combination = std::vector<Term>;

// sum(i, j) += scale * sum over the core's unknowns u of a[u][i] b[u][j]. Float products of at most 1024
// unknowns by BLAS, added in double in a fixed order: the same bits for any number of threads.
void add_products(const Tile& tile, const Combination& a, const Combination& b, double scale, int n_threads,
                  Matrix& sum);

// Replaces each value by its mean over the facet parts that a coarser refinement (a divisor of the tile's)
// does not tell apart.
void average_parts(const Tile& tile, int coarse_refinement, int n_threads, Fields& fields);

// Estimate of the sum over all values of a * b from every eighth run of 16 unknowns (all of a small surface),
// in a fixed order: enough to judge a series.
double sampled_inner_product(const Fields& a, const Fields& b);

}  // namespace gonio
