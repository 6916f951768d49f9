#include "scattering/visibility_bits.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "visibility/corrected_horizon.h"

namespace gonio {

namespace {

// As std::popcount, in steps that compilers turn into vectors on any instruction set.
int bit_count(uint32_t x) {
    x -= (x >> 1) & 0x55555555u;
    x = (x & 0x33333333u) + ((x >> 2) & 0x33333333u);
    x = (x + (x >> 4)) & 0x0f0f0f0fu;
    return static_cast<int>((x * 0x01010101u) >> 24);
}

}  // namespace

VisibilityBits find_visibility(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& directions,
                               const std::vector<SubSample>& sub_samples, bool skip_steep, int n_threads,
                               const Monitor& monitor) {
    VisibilityBits result;
    result.n_unknowns = tile.n_unknowns();
    result.n_sub_samples = static_cast<int>(sub_samples.size());
    result.bits.resize(directions.size() * result.n_unknowns);
    const size_t half = tile.n_slots() / 2;
    const uint32_t all = sub_samples.size() == most_bits ? ~0u : (1u << sub_samples.size()) - 1;
    struct Counts {
        double marched = 0, skipped = 0;
        int truncated = 0;
    };
    std::vector<Counts> counts(directions.size());
    parallel_for(static_cast<int>(directions.size()), n_threads, [&](int d) {
        monitor.check_cancelled();
        const Vec3& direction = directions[d];
        const double rays = static_cast<double>(tile.area.width) * tile.area.height *
                            static_cast<double>(sub_samples.size()) * 2 * tile.n_parts();
        uint32_t* to = result.bits.data() + d * result.n_unknowns;
        if (skip_steep && direction.z > grid.max_slope * std::hypot(direction.x, direction.y)) {
            std::fill_n(to, result.n_unknowns, all);
            counts[d].skipped = rays;
            return;
        }
        counts[d].marched = rays;
        std::fill_n(to, result.n_unknowns, 0u);
        std::vector<uint32_t> words(half / march_block);
        for (int part = 0; part < tile.n_parts(); ++part)
            for (int kind = 0; kind < 2; ++kind)
                for (size_t s = 0; s < sub_samples.size(); ++s) {
                    const FacetPoint point =
                        facet_point(kind, sub_samples[s].a, sub_samples[s].b, tile.refinement, part);
                    counts[d].truncated +=
                        visible_on_base(grid, direction, point, max_march_travel, tile.area, words.data());
                    uint32_t* slots = to + part * tile.n_slots() + kind * half;
                    for (size_t w = 0; w < words.size(); ++w, slots += march_block) {
                        if (words[w] == 0) continue;
                        for (int lane = 0; lane < march_block; ++lane)
                            slots[lane] |= ((words[w] >> lane) & 1u) << s;
                    }
                }
    });
    for (const Counts& c : counts) {
        result.rays += c.marched;
        result.rays_skipped += c.skipped;
        result.truncated_bundles += c.truncated;
    }
    return result;
}

void add_cosines(const Tile& tile, const std::vector<Vec3>& directions, const VisibilityBits& bits,
                 double share, int n_threads, VisibleCosines& visible) {
    const size_t n = directions.size(), stride = (n + 15) / 16 * 16;
    if (visible.values.empty()) {
        visible.stride = stride;
        visible.values.resize(stride * tile.n_unknowns());
        std::fill(visible.values.begin(), visible.values.end(), 0.0f);
    }
    constexpr size_t chunk =
        64;  // the bits of all directions for so many slots stay in the first-level cache
    const int n_chunks = static_cast<int>(tile.n_unknowns() / chunk);  // two kinds of rows of 32: no rest
    parallel_for(n_chunks, n_threads, [&](int k) {
        const size_t begin = k * chunk, end = std::min(begin + chunk, tile.n_unknowns());
        const size_t slot = begin % tile.n_slots();
        const float *nx = &tile.normal_x[slot], *ny = &tile.normal_y[slot], *nz = &tile.normal_z[slot];
        // Slot by slot for one direction, then direction by direction for one slot: both are vectors so.
        constexpr size_t block = 16;
        float cosines[block][chunk];
        for (size_t first = 0; first < n; first += block) {
            const size_t count = std::min(block, n - first);
            for (size_t c = 0; c < count; ++c) {
                const uint32_t* of = bits.of(static_cast<int>(first + c)) + begin;
                const float x = static_cast<float>(directions[first + c].x * share),
                            y = static_cast<float>(directions[first + c].y * share),
                            z = static_cast<float>(directions[first + c].z * share);
                for (size_t u = 0; u < end - begin; ++u)
                    cosines[c][u] = std::max(0.0f, x * nx[u] + y * ny[u] + z * nz[u]) *
                                    static_cast<float>(bit_count(of[u]));
            }
            for (size_t u = 0; u < end - begin; ++u) {
                float* to = &visible.values[(begin + u) * stride + first];
                for (size_t c = 0; c < count; ++c) to[c] += cosines[c][u];
            }
        }
    });
}

std::vector<double> projected_areas(const Tile& tile, const VisibleCosines& visible, int n_directions) {
    const std::vector<float> area = core_areas(tile);
    std::vector<double> sums(n_directions, 0.0);
    constexpr size_t stretch = 16;  // float sums over few slots, then double
    std::vector<float> lanes(visible.stride);
    for (size_t begin = 0; begin < tile.n_unknowns(); begin += stretch) {
        std::fill(lanes.begin(), lanes.end(), 0.0f);
        for (size_t u = begin; u < std::min(begin + stretch, tile.n_unknowns()); ++u) {
            const float a = area[u % tile.n_slots()];
            const float* row = visible.of(u);
            for (size_t c = 0; c < lanes.size(); ++c) lanes[c] += a * row[c];
        }
        for (int d = 0; d < n_directions; ++d) sums[d] += lanes[d];
    }
    return sums;
}

std::vector<float> core_areas(const Tile& tile) {
    std::vector<float> areas(tile.n_slots(), 0.0f);
    for (int kind = 0; kind < 2; ++kind)
        for (int row = tile.core.y0; row < tile.core.y0 + tile.core.height; ++row)
            for (int column = tile.core.x0; column < tile.core.x0 + tile.core.width; ++column) {
                const size_t slot = tile.slot(kind, row, column);
                areas[slot] = tile.sqrt_area[slot] * tile.sqrt_area[slot];
            }
    return areas;
}

}  // namespace gonio
