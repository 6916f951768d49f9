// Compiled once for every instruction set (Highway's foreach_target).
#include "visibility/horizon_sweep.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "visibility/horizon_sweep.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "visibility/horizon_sweep_lines.h"

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DI = hn::RebindToSigned<D>;
using VF = hn::Vec<D>;
using VI = hn::Vec<DI>;
using M = hn::Mask<D>;

// Vectors of lines that go together: enough to hide the latency of the gathers.
constexpr int hull_vectors = 4;

// Tangent points of hull_vectors vectors of lines that start at first_line: tangent[step * stride + line] is
// how many columns ahead of sample `step` the horizon stands. next, next_height: room for all steps of them.
void hull_of_lines(const SweepLines& lines, int first_line, int32_t* next, float* next_height,
                   int32_t* tangent, size_t tangent_stride) {
    const D d;
    const DI di;
    const int lanes = static_cast<int>(hn::Lanes(d)), together = hull_vectors * lanes;
    const MarchPlane& plane = *lines.plane;
    VI lane[hull_vectors], following[hull_vectors];
    VF height_ahead[hull_vectors], following_height[hull_vectors];
    for (int v = 0; v < hull_vectors; ++v) lane[v] = hn::Iota(di, v * lanes);
    const VI stride = hn::Set(di, together);

    for (int step = lines.n_steps - 1; step >= 0; --step) {
        const SweepLines::Sample& sample = lines.samples[step];
        int start = first_line + sample.shift;
        start -= start >= plane.nx ? plane.nx : 0;
        const float* p = plane.heights.data() + static_cast<size_t>(sample.row) * plane.stride + start;
        const VF w0 = hn::Set(d, sample.weight[0]), w1 = hn::Set(d, sample.weight[1]),
                 w2 = hn::Set(d, sample.weight[2]), here = hn::Set(d, static_cast<float>(step));
        const bool last = step == lines.n_steps - 1;
        for (int v = 0; v < hull_vectors; ++v) {
            const float* q = p + v * lanes;
            const VF height = hn::MulAdd(hn::LoadU(d, q), w0,
                                         hn::MulAdd(hn::LoadU(d, q + sample.second_node), w1,
                                                    hn::Mul(hn::LoadU(d, q + plane.stride + 1), w2)));
            // The end of the list is a sample that follows itself.
            VI touch = hn::Set(di, last ? step : step + 1), after = last ? touch : following[v];
            VF touch_height = last ? height : height_ahead[v],
               after_height = last ? height : following_height[v];
            VF rise = hn::Sub(touch_height, height), columns = hn::Set(d, 1.0f);
            for (;;) {
                const VF after_columns = hn::Sub(hn::ConvertTo(d, after), here),
                         after_rise = hn::Sub(after_height, height);
                const M walk = hn::And(hn::RebindMask(d, hn::Ne(after, touch)),
                                       hn::Ge(hn::Mul(after_rise, columns), hn::Mul(rise, after_columns)));
                if (hn::AllFalse(d, walk)) break;
                touch = hn::IfThenElse(hn::RebindMask(di, walk), after, touch);
                touch_height = hn::IfThenElse(walk, after_height, touch_height);
                rise = hn::IfThenElse(walk, after_rise, rise);
                columns = hn::IfThenElse(walk, after_columns, columns);
                const VI at = hn::Add(hn::Mul(touch, stride), lane[v]);
                after = hn::GatherIndex(di, next, at);
                after_height = hn::GatherIndex(d, next_height, at);
            }
            const size_t to = static_cast<size_t>(step) * together + v * lanes;
            hn::StoreU(touch, di, next + to);
            hn::StoreU(touch_height, d, next_height + to);
            height_ahead[v] = height;
            following[v] = touch;
            following_height[v] = touch_height;
            if (step < plane.ny)
                hn::StoreU(hn::Sub(touch, hn::Set(di, step)), di,
                           tangent + step * tangent_stride + first_line + v * lanes);
        }
    }
}

// The best of the receiver's own ray at one edge.
HWY_INLINE void keep_higher(VF slope, VF columns, VF& best, VF& best_columns) {
    const M higher = hn::Gt(slope, best);
    best = hn::IfThenElse(higher, slope, best);
    best_columns = hn::IfThenElse(higher, columns, best_columns);
}

// Receivers of one row of the plane: their rays at the edges around the tangent points of the two lines
// beside them, and at all edges of the mesh in the columns around the best of those. slope: height units a
// column. Both outputs hold plane.nx values, padded to whole vectors.
void polish_row(const SweepLines& lines, int step, const int32_t* tangent, float* slope, float* columns) {
    const D d;
    const DI di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const MarchPlane& plane = *lines.plane;
    const int row = lines.samples[step].row;
    const float* heights = plane.heights.data();
    const float* own = heights + static_cast<size_t>(row) * plane.stride;
    const int32_t* row_offset = lines.edge_rows.data() + step;
    const VI width = hn::Set(di, plane.nx), last = hn::Set(di, plane.nx - 1), one = hn::Set(di, 1),
             zero = hn::Zero(di);
    const VF first = hn::Set(d, static_cast<float>(lines.first_edge - 1));
    const bool on_edge = lines.first_edge == 1;

    for (int j = 0; j < plane.nx; j += lanes) {
        const float* p = own + j;
        const VF height = hn::MulAdd(
            hn::LoadU(d, p), hn::Set(d, lines.receiver_weight[0]),
            hn::MulAdd(hn::LoadU(d, p + lines.receiver_second_node), hn::Set(d, lines.receiver_weight[1]),
                       hn::Mul(hn::LoadU(d, p + plane.stride + 1), hn::Set(d, lines.receiver_weight[2]))));
        VF best = hn::Zero(d), best_columns = hn::Zero(d);
        for (const SweepLines::NearEdge& edge : lines.near_edges) {
            int r = row + edge.row, c = j + edge.column;
            r -= r >= plane.ny ? plane.ny : 0;
            c -= c >= plane.nx ? plane.nx : 0;
            const float* q = heights + static_cast<size_t>(r) * plane.stride + c;
            const VF at_edge = hn::MulAdd(hn::LoadU(d, q + edge.second_node), hn::Set(d, edge.weight1),
                                          hn::Mul(hn::LoadU(d, q), hn::Set(d, edge.weight0)));
            keep_higher(hn::Mul(hn::Sub(at_edge, height), hn::Set(d, 1 / edge.columns)),
                        hn::Set(d, edge.columns), best, best_columns);
        }
        int line = j + lines.samples[step].line_before;
        line -= line >= plane.nx ? plane.nx : 0;
        const VI place = hn::Iota(di, j);
        VF best_ahead = hn::Set(d, -1e30f);
        VI best_edge = one;
        auto look_at = [&](VI edge) {
            const VF far = hn::Add(hn::ConvertTo(d, edge), first);
            const VF across = hn::GatherIndex(d, lines.edge_shift.data(), edge), whole = hn::Floor(across),
                     weight = hn::Sub(across, whole);
            VI node = hn::Add(place, hn::ConvertTo(di, whole));
            node = hn::IfThenElse(hn::Gt(node, last), hn::Sub(node, width), node);
            const VI at = hn::Add(node, hn::GatherIndex(di, row_offset, edge));
            const VF h0 = hn::GatherIndex(d, heights, at), h1 = hn::GatherIndex(d, heights + 1, at);
            const VF seen = hn::Div(hn::Sub(hn::MulAdd(weight, hn::Sub(h1, h0), h0), height), far);
            const M higher = hn::Gt(seen, best_ahead);
            best_ahead = hn::IfThenElse(higher, seen, best_ahead);
            best_edge = hn::IfThenElse(hn::RebindMask(di, higher), edge, best_edge);
        };
        for (int beside = 0; beside < 2; ++beside) {
            const VI edge = hn::Max(hn::LoadU(di, tangent + line + beside), one);
            look_at(edge);
            if (!on_edge) look_at(hn::Add(edge, one));  // a sample between two edges between columns
        }
        if (on_edge) {
            const VI middle = best_edge;
            look_at(hn::Max(hn::Sub(middle, one), one));
            look_at(hn::Add(middle, one));
        }
        keep_higher(best_ahead, hn::Add(hn::ConvertTo(d, best_edge), first), best, best_columns);

        // The other edges in the columns before and behind the best one: from node m on the near side to node
        // m + climb on the far side, which the ray meets at the share (across - m) / (climb - shear).
        auto look_between = [&](VI edge, VI near_row, VI far_row) {
            const VF across = hn::GatherIndex(d, lines.edge_shift.data(), edge), whole = hn::Floor(across),
                     far = hn::Add(hn::ConvertTo(d, edge), first);
            for (const int climb : {0, lines.backwards ? -1 : 1}) {
                const float relative = static_cast<float>(climb) - lines.shear;
                if (relative == 0) continue;
                const int towards = relative > 0 ? -1 : 1;
                VF m = relative > 0 ? whole : hn::Add(whole, hn::Set(d, 1.0f));
                for (float met = 0; met < std::abs(relative); ++met) {
                    const VF share = hn::Mul(hn::Sub(across, m), hn::Set(d, 1 / relative));
                    VI node = hn::Add(place, hn::ConvertTo(di, m));
                    node = hn::IfThenElse(hn::Gt(node, last), hn::Sub(node, width), node);
                    node = hn::IfThenElse(hn::Lt(node, zero), hn::Add(node, width), node);
                    VI beyond = hn::Add(node, hn::Set(di, climb));
                    beyond = hn::IfThenElse(hn::Lt(beyond, zero), hn::Add(beyond, width), beyond);
                    const VF h0 = hn::GatherIndex(d, heights, hn::Add(near_row, node)),
                             h1 = hn::GatherIndex(d, heights, hn::Add(far_row, beyond));
                    const VF columns_ahead = hn::Add(far, share),
                             rise = hn::Sub(hn::MulAdd(share, hn::Sub(h1, h0), h0), height);
                    const VF seen =
                        hn::IfThenElseZero(hn::Le(share, hn::Set(d, 1.0f)), hn::Div(rise, columns_ahead));
                    keep_higher(seen, columns_ahead, best, best_columns);
                    m = hn::Add(m, hn::Set(d, static_cast<float>(towards)));
                }
            }
        };
        const VI before = hn::Max(hn::Sub(best_edge, one), one), behind = hn::Add(before, one);
        const VI row_0 = hn::GatherIndex(di, row_offset, before),
                 row_1 = hn::GatherIndex(di, row_offset, behind),
                 row_2 = hn::GatherIndex(di, row_offset, hn::Add(behind, one));
        look_between(before, row_0, row_1);
        look_between(behind, row_1, row_2);
        hn::StoreU(best, d, slope + j);
        hn::StoreU(best_columns, d, columns + j);
    }
}

int lines_together() {
    return hull_vectors * static_cast<int>(hn::Lanes(D()));
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
namespace {

HWY_EXPORT(hull_of_lines);
HWY_EXPORT(polish_row);
HWY_EXPORT(lines_together);

constexpr int most_lanes = 16;

}  // namespace

bool can_sweep(const MarchGrid& grid) {
    return grid.has_transposed() && grid.rows.nx >= march_block;
}

HorizonSlice sweep_horizon(const MarchGrid& grid, const RayBundle& flat, double travel) {
    const SweepLines lines = make_sweep_lines(grid, flat, travel);
    const MarchPlane& plane = *lines.plane;
    const int together = HWY_DYNAMIC_DISPATCH(lines_together)(), width = plane.nx;
    const size_t stride = static_cast<size_t>((width + together - 1) / together) * together + most_lanes;
    std::vector<int32_t> tangent(stride * plane.ny), next(static_cast<size_t>(lines.n_steps) * together);
    std::vector<float> next_height(next.size());
    for (int line = 0; line < width; line += together) HWY_DYNAMIC_DISPATCH(hull_of_lines)
    (lines, line, next.data(), next_height.data(), tangent.data(), stride);
    for (int step = 0; step < plane.ny; ++step) {  // lines go on where they began
        int32_t* row = &tangent[step * stride];
        for (size_t k = width; k < stride; ++k) row[k] = row[k - width];
    }

    HorizonSlice slice;
    slice.slope.resize(static_cast<size_t>(width) * plane.ny);
    slice.distance.resize(slice.slope.size());
    const float slope_unit = static_cast<float>(grid.pitch_x / lines.column),
                distance_unit = static_cast<float>(lines.column);
    constexpr int block = 16;
    const size_t padded = width + most_lanes;
    std::vector<float> slope(block * padded), columns(block * padded);
    for (int first = 0; first < plane.ny; first += block) {
        const int n = std::min(block, plane.ny - first);
        for (int r = 0; r < n; ++r) {
            const int step = lines.backwards ? wrap_index(-(first + r), plane.ny) : first + r;
            HWY_DYNAMIC_DISPATCH(polish_row)
            (lines, step, &tangent[step * stride], &slope[r * padded], &columns[r * padded]);
        }
        if (lines.transposed) {
            for (int c = 0; c < width; ++c)
                for (int r = 0; r < n; ++r) {
                    const size_t to = static_cast<size_t>(c) * plane.ny + first + r;
                    slice.slope[to] = slope_unit * slope[r * padded + c];
                    slice.distance[to] = distance_unit * columns[r * padded + c];
                }
        } else {
            for (int r = 0; r < n; ++r)
                for (int c = 0; c < width; ++c) {
                    const size_t to = static_cast<size_t>(first + r) * width + c;
                    slice.slope[to] = slope_unit * slope[r * padded + c];
                    slice.distance[to] = distance_unit * columns[r * padded + c];
                }
        }
    }
    return slice;
}

}  // namespace gonio
#endif  // HWY_ONCE
