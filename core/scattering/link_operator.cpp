#include "scattering/link_operator.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/parallel.h"
#include "scattering/moved_directions.h"
#include "scattering/ray_hits.h"
#include "scattering/turning.h"
#include "visibility/march.h"

namespace gonio {
namespace {

// One ray bundle of the operator: a direction from one part of one facet kind.
struct OperatorBundle {
    RayBundle rays;
    Vec3 direction;
    double weight;          // solid angle / (2 pi) times the number of parts: half of the symmetric link
    int kind, part, index;  // of the direction in its set
    Turning turning = {};   // on a curved base
};

// Lines of cells that are marched together. Bundles that march transposed run along y.
struct LineGroup {
    bool transposed;
    int kind, part;
    int first_line, n_lines;
};

struct PendingLink {
    uint32_t start;  // of the ray: line * width + position inside its group of lines
    Link link;
};
struct PendingLinks {
    std::vector<PendingLink> links;
    std::vector<LinkOrigin> origins;  // parallel, on a curved base
};

void trace_group(const MarchGrid& grid, const Tile& tile, const std::vector<OperatorBundle>& bundles,
                 const LineGroup& group, HitLines& lines, PendingLinks& pending, LinkOperator& counts) {
    constexpr uint32_t nothing = ~0u;
    const int width = group.transposed ? tile.area.height : tile.area.width, words = words_for(width);
    const uint32_t n_slots = static_cast<uint32_t>(tile.n_slots());
    for (const OperatorBundle& bundle : bundles) {
        if (bundle.rays.transposed != group.transposed || bundle.kind != group.kind ||
            bundle.part != group.part)
            continue;
        const int along = group.transposed ? tile.area.y0 : tile.area.x0,
                  across = group.transposed ? tile.area.x0 : tile.area.y0;
        march_hits(grid, bundle.rays, along, across + group.first_line, width, group.n_lines, lines);
        counts.rays += static_cast<double>(width) * group.n_lines;
        const float x = static_cast<float>(bundle.weight * bundle.direction.x),
                    y = static_cast<float>(bundle.weight * bundle.direction.y),
                    z = static_cast<float>(bundle.weight * bundle.direction.z);
        auto cosine = [&](size_t slot) {
            return x * tile.normal_x[slot] + y * tile.normal_y[slot] + z * tile.normal_z[slot];
        };
        const bool curved = grid.base.is_curved();
        auto arriving_cosine = [&](size_t slot, double travel) {
            if (!curved) return cosine(slot);
            const Vec3 d = bundle.turning.turned(bundle.direction, travel);
            return static_cast<float>(bundle.weight * (d.x * tile.normal_x[slot] + d.y * tile.normal_y[slot] +
                                                       d.z * tile.normal_z[slot]));
        };
        for (int line = 0; line < group.n_lines; ++line) {
            uint32_t seen = nothing, seen_slot = 0;
            double travel = 0;  // to what is seen
            for (int word = 0; word < words; ++word) {
                const size_t at = static_cast<size_t>(line) * words + word;
                for (uint32_t left = lines.hit[at]; left != 0; left &= left - 1) {
                    const int lane = std::countr_zero(left), position = word * march_block + lane;
                    const int k = lines.crossing[at * march_block + lane];
                    const CrossedFacet& facet = bundle.rays.facets[k];
                    const int column = group.transposed ? group.first_line + line : position;
                    const int row = group.transposed ? position : group.first_line + line;
                    int hit_column, hit_row;
                    if (hit_cell(tile, column + (group.transposed ? facet.row : facet.column),
                                 row + (group.transposed ? facet.column : facet.row), hit_column, hit_row)) {
                        const int kind = group.transposed ? 1 - facet.kind : facet.kind;
                        seen_slot = static_cast<uint32_t>(tile.slot(kind, hit_row, hit_column));
                        seen = seen_slot;
                        if (curved) travel = (bundle.rays.facets[k - 1].travel + facet.travel) / 2.0;
                        if (tile.refinement > 1)
                            seen += n_slots *
                                    static_cast<uint32_t>(hit_part(
                                        grid, bundle.rays, into_period(tile.area.x0 + column, tile.nx),
                                        into_period(tile.area.y0 + row, tile.ny), k, tile.refinement, kind));
                    } else if (seen == nothing) {
                        counts.dropped += 1;
                        continue;
                    } else {
                        counts.substituted +=
                            1;  // what the last ray of this direction saw stands in for what this one would
                    }
                    const size_t slot = tile.slot(group.kind, row, column);
                    // Every line between two facets can be found from either end, in proportion to the rays
                    // that each sends per projected area; the balance heuristic (Veach 1997, 9.2) shares it
                    // so. Half each would let the few rays of a tall wall outshout the many of the ground.
                    const float from = tile.sqrt_area[slot] * cosine(slot),
                                to = -tile.sqrt_area[seen_slot] * arriving_cosine(seen_slot, travel);
                    const float weight =
                        from > 0 && to > 0
                            ? 2 * from * to / (tile.sqrt_area[slot] * from + tile.sqrt_area[seen_slot] * to)
                            : 0.0f;
                    pending.links.push_back({static_cast<uint32_t>(line * width + position), {seen, weight}});
                    if (curved) pending.origins.push_back({bundle.index, static_cast<float>(travel)});
                }
            }
        }
    }
}

// Groups the pending links by the unknown they start from (counting sort, stable: the order of the directions
// stays).
void append_records(const Tile& tile, const LineGroup& group, const std::vector<Turning>& turnings,
                    const PendingLinks& pending, const BaseCurvature& base, LinkOperator::Chunk& chunk) {
    const int width = group.transposed ? tile.area.height : tile.area.width;
    std::vector<uint32_t> place(static_cast<size_t>(width) * group.n_lines, 0);
    for (const PendingLink& p : pending.links) ++place[p.start];
    uint32_t end = static_cast<uint32_t>(chunk.links.size());
    for (int line = 0; line < group.n_lines; ++line)
        for (int position = 0; position < width; ++position) {
            uint32_t& count = place[static_cast<size_t>(line) * width + position];
            const uint32_t begin = end;
            end += count;
            if (count > 0) {
                const int row = group.transposed ? position : group.first_line + line,
                          column = group.transposed ? group.first_line + line : position;
                chunk.records.push_back(
                    {static_cast<uint32_t>(group.part * tile.n_slots() + tile.slot(group.kind, row, column)),
                     begin});
            }
            count = begin;  // from now on: where the next link goes
        }
    chunk.links.resize(end);
    if (base.is_curved()) chunk.turns.resize(end);
    if (base.corrects_horizons()) chunk.origins.resize(end);
    for (size_t k = 0; k < pending.links.size(); ++k) {
        const uint32_t at = place[pending.links[k].start]++;
        chunk.links[at] = pending.links[k].link;
        if (!base.is_curved()) continue;
        const LinkOrigin& origin = pending.origins[k];
        chunk.turns[at] = turnings[origin.direction].turn(origin.travel);
        if (base.corrects_horizons()) chunk.origins[at] = origin;
    }
}

}  // namespace

LinkOperator build_link_operator(const MarchGrid& grid, const Tile& tile, const DirectionSet& set,
                                 const std::vector<SubSample>& jitter, int n_threads,
                                 const Monitor& monitor) {
    const int n_directions = static_cast<int>(set.directions.size()), n_parts = tile.n_parts();
    std::vector<OperatorBundle> bundles;
    std::vector<StartHeights> layers;  // parallel
    std::vector<Turning> turnings(n_directions);
    for (int i = 0; i < n_directions; ++i) {
        if (grid.base.is_curved()) turnings[i] = turning_along(grid, set.directions[i]);
        for (int kind = 0; kind < 2; ++kind)
            for (const StartHeights& layer : start_heights(grid, set.directions[i])) {
                bundles.push_back({{},
                                   set.directions[i],
                                   set.solid_angle[i] * n_parts / (2 * pi),
                                   kind,
                                   i % n_parts,
                                   i,
                                   turnings[i]});
                layers.push_back(layer);
            }
    }
    parallel_for(static_cast<int>(bundles.size()), n_threads, [&](int task) {
        OperatorBundle& bundle = bundles[task];
        const SubSample& place = jitter[bundle.index];
        const FacetPoint point = facet_point(bundle.kind, place.a, place.b, tile.refinement, bundle.part);
        bundle.rays = make_ray_bundle(grid, bundle.direction, point, max_march_travel, layers[task]);
    });

    constexpr int lines_together = 4;
    std::vector<LineGroup> groups;
    for (const bool transposed : {false, true})
        for (int part = 0; part < n_parts; ++part)
            for (int kind = 0; kind < 2; ++kind) {
                const int n_lines = transposed ? tile.area.width : tile.area.height;
                if (transposed && !grid.has_transposed()) continue;
                for (int line = 0; line < n_lines; line += lines_together)
                    groups.push_back(
                        {transposed, kind, part, line, std::min(lines_together, n_lines - line)});
            }

    LinkOperator op;
    constexpr int groups_per_chunk = 16;
    const int n_chunks = static_cast<int>((groups.size() + groups_per_chunk - 1) / groups_per_chunk);
    op.chunks.resize(n_chunks);
    std::vector<LinkOperator> counts(n_chunks);
    parallel_for(n_chunks, n_threads, [&](int c) {
        monitor.check_cancelled();
        HitLines lines;
        PendingLinks pending;
        for (size_t g = static_cast<size_t>(c) * groups_per_chunk;
             g < std::min(groups.size(), static_cast<size_t>(c + 1) * groups_per_chunk); ++g) {
            pending.links.clear();
            pending.origins.clear();
            trace_group(grid, tile, bundles, groups[g], lines, pending, counts[c]);
            append_records(tile, groups[g], turnings, pending, grid.base, op.chunks[c]);
        }
        op.chunks[c].records.push_back({0, static_cast<uint32_t>(op.chunks[c].links.size())});
    });
    if (grid.base.corrects_horizons()) weigh_moved_directions(grid, tile, set, n_threads, op);
    for (int c = 0; c < n_chunks; ++c) {
        op.rays += counts[c].rays;
        op.substituted += counts[c].substituted;
        op.dropped += counts[c].dropped;
        op.links += static_cast<double>(op.chunks[c].links.size());
    }
    return op;
}

void apply(const LinkOperator& op, const Fields& x, Fields& y, int n_threads) {
    parallel_for(x.n_blocks(), n_threads, [&](int block) {
        float* to = y.block(block);
        std::fill_n(to, y.n_unknowns() * column_block, 0.0f);
        for (const LinkOperator::Chunk& chunk : op.chunks)
            apply_links(chunk.records.data(), chunk.records.size() - 1, chunk.links.data(), x.block(block),
                        to);
    });
}

}  // namespace gonio
