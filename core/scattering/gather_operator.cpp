#include "scattering/gather_operator.h"

#include <algorithm>

#include "base/parallel.h"
#include "scattering/picture_kernels.h"

namespace gonio {

namespace {

template <int kColumns>
void gather_few(const GatherOperator& op, size_t begin, size_t end, const FewColumns& x, FewColumns& y,
                const std::vector<GatherSum<FewColumns>>& sums) {
    for (size_t u = begin; u < end; ++u) {
        float sum[kColumns] = {};
        for (uint32_t k = op.begin[u]; k < op.begin[u + 1]; ++k) {
            const float* seen = &x.values[static_cast<size_t>(op.links[k].seen) * kColumns];
            for (int c = 0; c < kColumns; ++c) sum[c] += op.links[k].weight * seen[c];
        }
        for (int c = 0; c < kColumns; ++c) {
            y.values[u * kColumns + c] = sum[c];
            for (const GatherSum<FewColumns>& to : sums)
                to.columns->values[u * kColumns + c] += to.factor * sum[c];
        }
    }
}

}  // namespace

GatherOperator gather_operator(const LinkOperator& op, const Tile& tile) {
    const auto for_links = [&](auto&& use) {
        for (const LinkOperator::Chunk& chunk : op.chunks)
            for (size_t r = 0; r + 1 < chunk.records.size(); ++r)
                for (uint32_t k = chunk.records[r].begin; k < chunk.records[r + 1].begin; ++k)
                    if (chunk.links[k].weight > 0) use(chunk.records[r].unknown, chunk.links[k]);
    };
    GatherOperator gather;
    gather.begin.assign(tile.n_unknowns() + 2, 0);
    uint32_t* count = gather.begin.data() + 2;
    for_links([&](uint32_t from, const Link& link) {
        ++count[from];
        ++count[link.seen];
    });
    for (size_t u = 2; u < gather.begin.size(); ++u) gather.begin[u] += gather.begin[u - 1];
    gather.links.resize(gather.begin.back());
    std::vector<float> root, inverse;  // of the area, per unknown
    for (int part = 0; part < tile.n_parts(); ++part)
        for (const float r : tile.sqrt_area) {
            root.push_back(r);
            inverse.push_back(r > 0 ? 1 / r : 0.0f);
        }
    uint32_t* next = gather.begin.data() + 1;  // in the end: where the next unknown begins
    for_links([&](uint32_t from, const Link& link) {
        gather.links[next[from]++] = {link.seen, link.weight * root[link.seen] * inverse[from]};
        gather.links[next[link.seen]++] = {from, link.weight * root[from] * inverse[link.seen]};
    });
    gather.begin.pop_back();
    return gather;
}

GatherOperator weighed_by(GatherOperator op, const Tile& tile, const std::vector<float>& albedo) {
    for (Link& link : op.links) link.weight *= albedo[link.seen % tile.n_slots()];
    return op;
}

void gather(const GatherOperator& op, const Tile& tile, const Fields& x, Fields& y,
            const std::vector<GatherSum<Fields>>& sums, int n_threads) {
    // Squares of cells, so that what they see stays in the second-level cache.
    constexpr int square = 64;
    const int columns = (tile.stride + square - 1) / square, rows = (tile.area.height + square - 1) / square,
              n_squares = columns * rows;
    std::vector<float> factors;
    for (const GatherSum<Fields>& sum : sums) factors.push_back(sum.factor);
    parallel_for(n_squares * x.n_blocks(), n_threads, [&](int task) {
        const int block = task / n_squares, x0 = task % n_squares % columns * square,
                  y0 = task % n_squares / columns * square;
        std::vector<float*> to;
        for (const GatherSum<Fields>& sum : sums) to.push_back(sum.columns->block(block));
        for (int row = y0; row < std::min(y0 + square, tile.area.height); ++row)
            for (int part = 0; part < tile.n_parts(); ++part)
                for (int kind = 0; kind < 2; ++kind)
                    gather_links(op.begin.data(), op.links.data(),
                                 part * tile.n_slots() + tile.slot(kind, row, x0),
                                 std::min(square, tile.stride - x0), x.block(block), y.block(block),
                                 to.size(), factors.data(), to.data());
    });
}

void gather(const GatherOperator& op, const Tile& tile, const FewColumns& x, FewColumns& y,
            const std::vector<GatherSum<FewColumns>>& sums, int n_threads) {
    constexpr decltype(&gather_few<1>) with[] = {gather_few<1>, gather_few<2>, gather_few<3>, gather_few<4>};
    constexpr size_t chunk = 8192;
    const size_t n = tile.n_unknowns();
    parallel_for(static_cast<int>((n + chunk - 1) / chunk), n_threads, [&](int k) {
        with[x.n_columns - 1](op, k * chunk, std::min(n, (k + 1) * chunk), x, y, sums);
    });
}

}  // namespace gonio
