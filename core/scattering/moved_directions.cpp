#include "scattering/moved_directions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "visibility/curvature.h"
#include "visibility/direction_mesh.h"

namespace gonio {
namespace {

MovedDirections::Fans make_fans(const DirectionSet& set, int part, int n_parts) {
    MovedDirections::Fans fans;
    fans.place.assign(set.directions.size(), -1);
    double z_max = 0;
    for (size_t i = part; i < set.directions.size(); i += n_parts) {
        fans.place[i] = static_cast<int>(fans.still.size());
        fans.still.push_back(set.directions[i]);
        z_max = std::max(z_max, std::abs(set.directions[i].z));
    }
    // As dense as the others; at least the poles and a ring below each.
    const double n = static_cast<double>(fans.still.size());
    const int n_caps = std::max(8, static_cast<int>(n * (1 - z_max) / std::max(z_max, 0.05)));
    for (int k = 0; k < n_caps; ++k) {
        const double z = 1 - (1 - z_max) * (2 * (k / 2) + 0.5) / n_caps * 0.999,
                     phi = 2 * pi * fractional_part(0.6180339887498949 * k);
        const double r = safe_sqrt(1 - z * z);
        fans.still.push_back({r * std::cos(phi), r * std::sin(phi), k % 2 == 0 ? z : -z});
    }
    fans.mesh = triangulate(fans.still);
    fan_solid_angles(fans.mesh, fans.still, fans.solid_angle);
    return fans;
}

// Directions that meet nothing move with those beside them that do: what they pass is the horizon, which
// bends away with the relief. Were they to stay, the gap between would open on both sides of the horizon
// alike, and only half of what bending hides would be lost.
void move_horizon(const MovedDirections::Fans& fans, const std::vector<char>& meets,
                  std::vector<Vec3>& moved) {
    std::vector<Vec3> shift(moved.size());
    std::vector<int> n(moved.size(), 0);
    for (const std::array<int, 3>& triangle : fans.mesh.triangles)
        for (int side = 0; side < 3; ++side) {
            const int a = triangle[side], b = triangle[(side + 1) % 3];
            for (const auto& [from, to] : {std::pair{a, b}, {b, a}}) {
                if (!meets[from] || meets[to]) continue;
                shift[to].x += moved[from].x - fans.still[from].x;
                shift[to].y += moved[from].y - fans.still[from].y;
                shift[to].z += moved[from].z - fans.still[from].z;
                ++n[to];
            }
        }
    for (size_t k = 0; k < moved.size(); ++k) {
        if (n[k] == 0) continue;
        const Vec3 d{moved[k].x + shift[k].x / n[k], moved[k].y + shift[k].y / n[k],
                     moved[k].z + shift[k].z / n[k]};
        const double length = std::sqrt(dot(d, d));
        moved[k] = {d.x / length, d.y / length, d.z / length};
    }
}

// Links of one unknown: they may stand in two chunks, by the axis along which they were marched.
struct Record {
    uint32_t unknown, chunk, begin, end;
};

Vec3 between(const Vec3& from, const Vec3& to) {
    const Vec3 d{to.x - from.x, to.y - from.y, to.z - from.z};
    const double length = std::sqrt(dot(d, d));
    return {d.x / length, d.y / length, d.z / length};
}

// Metres above the mean: facets are small against the radius of the base, so their middle stands for them.
double middle_height(const MarchGrid& grid, const Tile& tile, size_t slot) {
    const int kind = static_cast<int>(slot / (static_cast<size_t>(tile.area.height) * tile.stride)),
              row = static_cast<int>(slot / tile.stride) % tile.area.height,
              column = static_cast<int>(slot % tile.stride);
    const MarchPlane& plane = grid.rows;
    const float* node = &plane.heights[static_cast<size_t>((tile.area.y0 + row) % plane.ny) * plane.stride +
                                       (tile.area.x0 + column) % plane.nx];
    return grid.pitch_x *
           (static_cast<double>(node[0]) + node[kind == 0 ? 1 : plane.stride] + node[plane.stride + 1]) / 3;
}

}  // namespace

MovedDirections::MovedDirections(const MarchGrid& grid, const Tile& tile, const DirectionSet& set,
                                 int n_threads)
    : grid_(grid), tile_(tile), set_(set), fans_(tile.n_parts()) {
    parallel_for(tile.n_parts(), n_threads,
                 [&](int part) { fans_[part] = make_fans(set, part, tile.n_parts()); });
}

void MovedDirections::move(size_t unknown, std::span<const LinkOrigin> met, Scratch& scratch,
                           std::vector<MovedDirection>& out) const {
    const Fans& own = fans_[unknown / tile_.n_slots()];
    const double height = middle_height(grid_, tile_, unknown % tile_.n_slots());
    std::vector<Vec3>& moved = scratch.moved;
    moved = own.still;
    scratch.meets.assign(moved.size(), 0);
    out.clear();
    for (const LinkOrigin& origin : met) {
        const Vec3& d = set_.directions[origin.direction];
        const MarchDirection step = to_march_direction(grid_, d);
        const double x = origin.travel * step.step_x * grid_.pitch_x,
                     y = origin.travel * step.step_y * grid_.pitch_y,
                     rise = d.z * std::hypot(x, y) / std::hypot(d.x, d.y);
        const int place = own.place[origin.direction];
        scratch.meets[place] = 1;
        moved[place] = between({0, 0, height}, displaced_position(grid_.base, x, y, height + rise));
        out.push_back({moved[place], turned_direction(moved[place], grid_.base, x, y), 0});
    }
    move_horizon(own, scratch.meets, moved);
    fan_solid_angles(own.mesh, moved, scratch.solid_angle);
    for (size_t k = 0; k < met.size(); ++k) {
        const int place = own.place[met[k].direction];
        out[k].growth = std::max(0.0, scratch.solid_angle[place] / own.solid_angle[place]);
    }
}

void weigh_moved_directions(const MarchGrid& grid, const Tile& tile, const DirectionSet& set, int n_threads,
                            LinkOperator& op) {
    const MovedDirections directions(grid, tile, set, n_threads);
    std::vector<Record> records;
    for (size_t c = 0; c < op.chunks.size(); ++c) {
        const auto& list = op.chunks[c].records;
        for (size_t r = 0; r + 1 < list.size(); ++r)
            records.push_back({list[r].unknown, static_cast<uint32_t>(c), list[r].begin, list[r + 1].begin});
    }
    std::stable_sort(records.begin(), records.end(),
                     [](const Record& a, const Record& b) { return a.unknown < b.unknown; });

    auto cosine = [&](const Vec3& d, size_t slot) {
        return d.x * tile.normal_x[slot] + d.y * tile.normal_y[slot] + d.z * tile.normal_z[slot];
    };
    constexpr size_t records_together = 256;
    const int n_tasks = static_cast<int>((records.size() + records_together - 1) / records_together);
    parallel_for(n_tasks, n_threads, [&](int task) {
        MovedDirections::Scratch scratch;
        std::vector<LinkOrigin> met;
        std::vector<MovedDirection> moved;
        // From the first record of an unknown to the last of another, wherever the tasks' borders fall.
        size_t r = task * records_together;
        while (r > 0 && r < records.size() && records[r].unknown == records[r - 1].unknown) ++r;
        const size_t task_end = std::min(records.size(), (task + 1) * records_together);
        while (r < task_end) {
            size_t end = r;
            while (end < records.size() && records[end].unknown == records[r].unknown) ++end;
            const size_t slot = records[r].unknown % tile.n_slots();
            met.clear();
            for (size_t k = r; k < end; ++k) {
                const auto& origins = op.chunks[records[k].chunk].origins;
                met.insert(met.end(), origins.begin() + records[k].begin, origins.begin() + records[k].end);
            }
            directions.move(records[r].unknown, met, scratch, moved);
            const MovedDirection* to = moved.data();
            for (size_t k = r; k < end; ++k)
                for (uint32_t l = records[k].begin; l < records[k].end; ++l, ++to) {
                    LinkOperator::Chunk& chunk = op.chunks[records[k].chunk];
                    const size_t seen = chunk.links[l].seen % tile.n_slots();
                    const double a = tile.sqrt_area[slot], b = tile.sqrt_area[seen];
                    const double leave = a * cosine(to->leaving, slot),
                                 arrive = -b * cosine(to->arriving, seen);
                    const double importance =
                        set.solid_angle[chunk.origins[l].direction] * tile.n_parts() / (2 * pi) * to->growth;
                    chunk.links[l].weight =
                        leave > 0 && arrive > 0
                            ? static_cast<float>(importance * 2 * leave * arrive / (a * leave + b * arrive))
                            : 0.0f;
                }
            r = end;
        }
    });
}

}  // namespace gonio
