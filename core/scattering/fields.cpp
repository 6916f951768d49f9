#include "scattering/fields.h"

#include <cblas.h>

#include <algorithm>

#include "base/parallel.h"
#include "visibility/crossings.h"

namespace gonio {
namespace {

// [run][n_columns] of the combination, so that BLAS sees one matrix.
void pack(const Combination& terms, size_t first, size_t count, int padded_columns,
          std::vector<float>& panel) {
    panel.resize(count * padded_columns);
    for (int b = 0; b < terms[0].fields->n_blocks(); ++b)
        for (size_t t = 0; t < terms.size(); ++t) {
            const float* from = terms[t].fields->block(b) + first * column_block;
            float* to = panel.data() + static_cast<size_t>(b) * column_block;
            const float factor = static_cast<float>(terms[t].factor);
            for (size_t k = 0; k < count; ++k, from += column_block, to += padded_columns)
                for (int c = 0; c < column_block; ++c) to[c] = (t == 0 ? 0.0f : to[c]) + factor * from[c];
        }
}

}  // namespace

Fields first_block(const Fields& fields) {
    Fields block(fields.n_unknowns(), std::min(column_block, fields.n_columns()));
    std::copy_n(fields.block(0), block.values().size(), block.block(0));
    return block;
}

void add_products(const Tile& tile, const Combination& a, const Combination& b, double scale, int n_threads,
                  Matrix& sum) {
    // Two levels of threads would fight; and a BLAS that splits sums by its own thread count would change
    // their bits.
    [[maybe_unused]] static const bool single_threaded_blas = (openblas_set_num_threads(1), true);
    std::vector<Tile::Run> runs;
    for (int part = 0; part < tile.n_parts(); ++part)
        for (Tile::Run run : tile.core_runs()) {
            run.first += part * tile.n_slots();
            runs.push_back(run);
        }
    const bool same = &a == &b;
    const int rows = a[0].fields->n_blocks() * column_block, columns = b[0].fields->n_blocks() * column_block;
    const size_t size = static_cast<size_t>(rows) * columns;
    // A fixed number of groups, each with its own sum: few where the sums are large.
    const int n_groups =
        static_cast<int>(std::clamp<size_t>((size_t{64} << 20) / (size * sizeof(double)), 2, 16));
    std::vector<std::vector<double>> partial(n_groups);
    parallel_for(n_groups, n_threads, [&](int group) {
        std::vector<double>& total = partial[group];
        total.assign(size, 0.0);
        std::vector<float> panel_a, panel_b, product(size);
        const size_t begin = runs.size() * group / n_groups, end = runs.size() * (group + 1) / n_groups;
        for (size_t r = begin; r < end; ++r) {
            pack(a, runs[r].first, runs[r].count, rows, panel_a);
            if (!same) pack(b, runs[r].first, runs[r].count, columns, panel_b);
            cblas_sgemm(CblasRowMajor, CblasTrans, CblasNoTrans, rows, columns,
                        static_cast<int>(runs[r].count), 1.0f, panel_a.data(), rows,
                        same ? panel_a.data() : panel_b.data(), columns, 0.0f, product.data(), columns);
            for (size_t k = 0; k < size; ++k) total[k] += product[k];
        }
    });
    for (int i = 0; i < sum.rows; ++i)
        for (int j = 0; j < sum.columns; ++j) {
            double total = 0;
            for (const auto& p : partial) total += p[static_cast<size_t>(i) * columns + j];
            sum(i, j) += scale * total;
        }
}

void average_parts(const Tile& tile, int coarse_refinement, int n_threads, Fields& fields) {
    const int n_parts = tile.n_parts(), n_coarse = coarse_refinement * coarse_refinement;
    std::vector<std::vector<int>> children(n_coarse);
    for (int part = 0; part < n_parts; ++part) {
        const FacetPoint centroid = facet_point(0, 2.0 / 3, 1.0 / 3, tile.refinement, part);
        children[facet_part(0, centroid.u, centroid.v, coarse_refinement)].push_back(part);
    }
    constexpr size_t chunk = 1024;
    const int n_chunks = static_cast<int>((tile.n_slots() + chunk - 1) / chunk);
    parallel_for(n_chunks * fields.n_blocks(), n_threads, [&](int task) {
        float* values = fields.block(task / n_chunks);
        const size_t begin = task % n_chunks * chunk, end = std::min(begin + chunk, tile.n_slots());
        for (const std::vector<int>& group : children)
            for (size_t slot = begin; slot < end; ++slot) {
                float mean[column_block] = {};
                auto row = [&](int part) { return values + (part * tile.n_slots() + slot) * column_block; };
                for (const int part : group)
                    for (int c = 0; c < column_block; ++c) mean[c] += row(part)[c];
                for (const int part : group)
                    for (int c = 0; c < column_block; ++c)
                        row(part)[c] = mean[c] / static_cast<float>(group.size());
            }
    });
}

double sampled_inner_product(const Fields& a, const Fields& b) {
    // Short runs, so that every part of the surface is looked at; everything if the surface is small or the
    // sample met nothing.
    constexpr size_t run = 16 * column_block;
    const HugeFloats &x = a.values(), &y = b.values();
    auto sum = [&](size_t stride) {
        double total = 0;
        for (size_t begin = 0; begin < x.size(); begin += stride) {
            float lanes[column_block] = {};
            for (size_t k = begin; k < std::min(x.size(), begin + run); k += column_block)
                for (int c = 0; c < column_block; ++c) lanes[c] += x[k + c] * y[k + c];
            for (const float lane : lanes) total += lane;
        }
        return total;
    };
    const double sampled = a.n_unknowns() > 20000 ? sum(8 * run) : 0.0;
    return sampled != 0 ? 8 * sampled : sum(run);
}

}  // namespace gonio
