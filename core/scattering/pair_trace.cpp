// Which facets see which along the shared directions.
#include <algorithm>
#include <bit>
#include <numeric>

#include "base/parallel.h"
#include "scattering/moved_directions.h"
#include "scattering/pair_graph.h"
#include "scattering/ray_hits.h"
#include "scattering/turning.h"
#include "visibility/march.h"

namespace gonio {
namespace {

struct DirectionPairs {
    std::vector<uint32_t> start, seen;
    std::vector<float> travel;  // to what is seen, in cells, on a curved base
    double rays = 0, substituted = 0, dropped = 0;
};

// All rays of one direction and facet kind: those of the blocks whose turn it is.
void trace_direction(const MarchGrid& grid, const Tile& tile, const RayBundle& rays, int kind, int part,
                     int subset, int turn, HitLines& lines, DirectionPairs& pairs) {
    constexpr uint32_t nothing = ~0u;
    const bool turned = rays.transposed;
    const int along = turned ? tile.area.y0 : tile.area.x0, across = turned ? tile.area.x0 : tile.area.y0;
    const int width = turned ? tile.area.height : tile.area.width,
              n_lines = turned ? tile.area.width : tile.area.height, words = words_for(width);
    const uint32_t part_first = static_cast<uint32_t>(part * tile.n_slots());
    for (int line = 0; line < n_lines; ++line)
        for (int word = 0; word < words; ++word) {
            if ((line + 2 * word + turn) % subset != 0) continue;
            const int begin = word * march_block, count = std::min(march_block, width - begin);
            march_hits(grid, rays, into_period(along + begin, turned ? tile.ny : tile.nx),
                       into_period(across + line, turned ? tile.nx : tile.ny), count, 1, lines);
            pairs.rays += count;
            uint32_t seen = nothing;
            float travel = 0;
            for (uint32_t left = lines.hit[0]; left != 0; left &= left - 1) {
                const int lane = std::countr_zero(left), k = lines.crossing[lane];
                const CrossedFacet& facet = rays.facets[k];
                const int column = turned ? line : begin + lane, row = turned ? begin + lane : line;
                int hit_column, hit_row;
                if (hit_cell(tile, column + (turned ? facet.row : facet.column),
                             row + (turned ? facet.column : facet.row), hit_column, hit_row)) {
                    const int hit_kind = turned ? 1 - facet.kind : facet.kind;
                    seen = static_cast<uint32_t>(tile.slot(hit_kind, hit_row, hit_column));
                    travel = (rays.facets[k - 1].travel + facet.travel) / 2;
                    if (tile.refinement > 1)
                        seen += static_cast<uint32_t>(tile.n_slots()) *
                                static_cast<uint32_t>(hit_part(
                                    grid, rays, into_period(tile.area.x0 + column, tile.nx),
                                    into_period(tile.area.y0 + row, tile.ny), k, tile.refinement, hit_kind));
                } else if (seen == nothing) {
                    pairs.dropped += 1;
                    continue;
                } else {
                    pairs.substituted += 1;
                }
                pairs.start.push_back(part_first + static_cast<uint32_t>(tile.slot(kind, row, column)));
                pairs.seen.push_back(seen);
                if (grid.base.is_curved()) pairs.travel.push_back(travel);
            }
        }
}

// first[u] .. first[u + 1] for keys in [0, n).
std::vector<uint32_t> group_starts(const std::vector<uint32_t>& keys, size_t n) {
    std::vector<uint32_t> first(n + 1, 0);
    for (const uint32_t key : keys) ++first[key + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    return first;
}

PairDirection as_floats(const Vec3& d) {
    return {static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)};
}

// How the pairs bend, from what each travels; grouped by start.
void bend_pairs(const MarchGrid& grid, const Tile& tile, const DirectionSet& set,
                const std::vector<float>& travel, int n_threads, PairGraph& graph) {
    std::vector<Turning> turnings;
    for (const Vec3& d : set.directions) turnings.push_back(turning_along(grid, d));
    graph.bends.resize(graph.size());
    for (size_t e = 0; e < graph.size(); ++e) {
        const Turning& turning = turnings[graph.direction[e]];
        const Vec3& d = set.directions[graph.direction[e]];
        graph.bends[e] = {as_floats(d), as_floats(turning.turned(d, travel[e])), turning.turn(travel[e]), 1};
    }
    if (!grid.base.corrects_horizons()) return;
    const MovedDirections directions(grid, tile, set, n_threads);
    parallel_for(static_cast<int>(tile.n_unknowns() / march_block), n_threads, [&](int block) {
        MovedDirections::Scratch scratch;
        std::vector<LinkOrigin> met;
        std::vector<MovedDirection> moved;
        for (size_t u = block * march_block; u < static_cast<size_t>(block + 1) * march_block; ++u) {
            const uint32_t begin = graph.out[u], end = graph.out[u + 1];
            if (begin == end) continue;
            met.clear();
            for (uint32_t e = begin; e < end; ++e)
                met.push_back({static_cast<int>(graph.direction[e]), travel[e]});
            directions.move(u, met, scratch, moved);
            for (uint32_t e = begin; e < end; ++e) {
                const MovedDirection& m = moved[e - begin];
                graph.bends[e].leaving = as_floats(m.leaving);
                graph.bends[e].arriving = as_floats(m.arriving);
                graph.bends[e].growth = static_cast<float>(m.growth);
            }
        }
    });
}

}  // namespace

int facet_subset(const Tile& tile, const BaseCurvature& base, int n_directions) {
    // Fans of directions that move are those of all that a facet traces.
    if (base.corrects_horizons()) return 1;
    const int blocks = words_for(tile.area.width) * tile.area.height;
    // i mod these numbers takes a good lattice out of the golden one (not so 5 or 8).
    for (const int subset : {9, 6, 4, 2})
        if (n_directions >= 7 * subset * tile.n_parts() && blocks >= 8 * subset) return subset;
    return 1;
}

PairGraph trace_pairs(const MarchGrid& grid, const Tile& tile, const DirectionSet& set,
                      const std::vector<SubSample>& jitter, int subset, int offset, int n_threads,
                      const Monitor& monitor) {
    const int n_directions = static_cast<int>(set.directions.size()), n_parts = tile.n_parts();
    std::vector<DirectionPairs> found(n_directions);
    parallel_for(n_directions, n_threads, [&](int i) {
        monitor.check_cancelled();
        HitLines lines;
        // Parts of a refined tile take turns, too.
        const int part = i % n_parts;
        for (int kind = 0; kind < 2; ++kind) {
            const FacetPoint point = facet_point(kind, jitter[i].a, jitter[i].b, tile.refinement, part);
            for (const StartHeights& layer : start_heights(grid, set.directions[i])) {
                const RayBundle rays =
                    make_ray_bundle(grid, set.directions[i], point, max_march_travel, layer);
                trace_direction(grid, tile, rays, kind, part, subset,
                                i / n_parts + offset + kind * (subset / 2), lines, found[i]);
            }
        }
    });
    PairGraph graph;
    graph.directions = DirectionArrays(set.directions);
    graph.solid_angle = set.solid_angle.front() * subset * n_parts;
    std::vector<uint32_t> starts;
    for (const DirectionPairs& pairs : found) {
        starts.insert(starts.end(), pairs.start.begin(), pairs.start.end());
        graph.rays += pairs.rays;
        graph.substituted += pairs.substituted;
        graph.dropped += pairs.dropped;
    }
    const size_t n = starts.size();
    graph.out = group_starts(starts, tile.n_unknowns());
    for (auto* list : {&graph.start, &graph.seen, &graph.direction, &graph.arriving}) list->resize(n);
    std::vector<float> travel(grid.base.is_curved() ? n : 0);
    std::vector<uint32_t> place(graph.out.begin(), graph.out.end() - 1);
    for (int i = 0; i < n_directions; ++i)
        for (size_t k = 0; k < found[i].start.size(); ++k) {
            const uint32_t e = place[found[i].start[k]]++;
            graph.start[e] = found[i].start[k];
            graph.seen[e] = found[i].seen[k];
            graph.direction[e] = static_cast<uint32_t>(i);
            if (grid.base.is_curved()) travel[e] = found[i].travel[k];
        }
    if (grid.base.is_curved()) bend_pairs(grid, tile, set, travel, n_threads, graph);
    graph.in = group_starts(graph.seen, tile.n_unknowns());
    place.assign(graph.in.begin(), graph.in.end() - 1);
    for (size_t e = 0; e < n; ++e) graph.arriving[place[graph.seen[e]]++] = static_cast<uint32_t>(e);
    return graph;
}

}  // namespace gonio
