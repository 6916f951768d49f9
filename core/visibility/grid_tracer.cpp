// Kernel of the grid tracer; this file is compiled once for every instruction set (Highway's foreach_target).
#include "visibility/grid_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/error.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "visibility/grid_tracer.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DI = hn::RebindToSigned<D>;
using VF = hn::Vec<D>;
using VI = hn::Vec<DI>;
using M = hn::Mask<D>;

struct Rays {
    VI i, j;
    VF u, v, z, dx, dy, dz;
    VI id;
};

HWY_INLINE Rays load(const RayBatch& b, size_t at) {
    const D d;
    const DI di;
    return {hn::LoadU(di, &b.i[at]), hn::LoadU(di, &b.j[at]), hn::LoadU(d, &b.u[at]),
            hn::LoadU(d, &b.v[at]),  hn::LoadU(d, &b.z[at]),  hn::LoadU(d, &b.dx[at]),
            hn::LoadU(d, &b.dy[at]), hn::LoadU(d, &b.dz[at]), hn::LoadU(di, &b.id[at])};
}

#if HWY_TARGET <= HWY_AVX3 || HWY_TARGET == HWY_SCALAR
// Brings the lanes of a mask to the front.
struct Packing {
    M mask;

    HWY_INLINE explicit Packing(M lanes) : mask(lanes) {}
    HWY_INLINE VF operator()(VF values) const { return hn::Compress(values, mask); }
    HWY_INLINE VI operator()(VI values) const { return hn::Compress(values, hn::RebindMask(DI(), mask)); }
};
#else
// [mask]: its lanes, then whichever.
constexpr size_t most_lanes = hn::MaxLanes(DI());
constexpr auto lanes_of_masks = [] {
    std::array<std::array<int32_t, most_lanes>, size_t{1} << most_lanes> table{};
    for (size_t mask = 0; mask < table.size(); ++mask) {
        size_t n = 0;
        for (size_t lane = 0; lane < most_lanes; ++lane)
            if (mask >> lane & 1) table[mask][n++] = static_cast<int32_t>(lane);
    }
    return table;
}();

// Brings the lanes of a mask to the front. Compress of Highway 1.0 does, too, but GCC 12 copies its table to
// the stack at every call: half the time of a ray.
struct Packing {
    decltype(hn::SetTableIndices(DI(), static_cast<const int32_t*>(nullptr))) lanes;

    HWY_INLINE explicit Packing(M mask) {
        uint8_t bits[8];
        hn::StoreMaskBits(D(), mask, bits);
        lanes = hn::SetTableIndices(DI(), lanes_of_masks[bits[0]].data());
    }
    HWY_INLINE VI operator()(VI values) const { return hn::TableLookupLanes(values, lanes); }
    HWY_INLINE VF operator()(VF values) const { return hn::BitCast(D(), (*this)(hn::BitCast(DI(), values))); }
};
#endif

// Appends the lanes of the mask. Whole vectors are stored, over what comes later and the batch's padding:
// stores of some lanes take several times as long.
HWY_INLINE void append(const Rays& r, M mask, RayBatch& b) {
    const D d;
    const DI di;
    const Packing packed(mask);
    const size_t at = b.n;
    hn::StoreU(packed(r.i), di, &b.i[at]);
    hn::StoreU(packed(r.j), di, &b.j[at]);
    hn::StoreU(packed(r.u), d, &b.u[at]);
    hn::StoreU(packed(r.v), d, &b.v[at]);
    hn::StoreU(packed(r.z), d, &b.z[at]);
    hn::StoreU(packed(r.dx), d, &b.dx[at]);
    hn::StoreU(packed(r.dy), d, &b.dy[at]);
    hn::StoreU(packed(r.dz), d, &b.dz[at]);
    hn::StoreU(packed(r.id), di, &b.id[at]);
    b.n += hn::CountTrue(d, mask);
}

struct Corners {
    VF h00, h10, h01, h11;
};

// Of a cell in every lane.
HWY_INLINE Corners corners_of(const TraceGrid& grid, VI cell) {
    const D d;
#if HWY_TARGET <= HWY_AVX3 || HWY_TARGET == HWY_SCALAR
    const VI corner = hn::ShiftLeft<2>(cell);
    const float* first = grid.corners.data();
    return {hn::GatherIndex(d, first, corner), hn::GatherIndex(d, first + 1, corner),
            hn::GatherIndex(d, first + 2, corner), hn::GatherIndex(d, first + 3, corner)};
#else
    // A load a cell and a transposition: gathers take twice as long.
    const DI di;
    alignas(64) int32_t at[hn::MaxLanes(di)];
    hn::Store(cell, di, at);
    const hn::CappedTag<float, 4> four;
    const auto cells = [&](int first) HWY_ATTR {
        const auto low = hn::LoadU(four, &grid.corners[4 * static_cast<size_t>(at[first])]);
#if HWY_TARGET == HWY_AVX2
        return hn::Combine(d, hn::LoadU(four, &grid.corners[4 * static_cast<size_t>(at[first + 4])]), low);
#else
        return low;
#endif
    };
    const VF a = cells(0), b = cells(1), c = cells(2), e = cells(3);
    const VF ac_low = hn::InterleaveLower(d, a, c), be_low = hn::InterleaveLower(d, b, e),
             ac_high = hn::InterleaveUpper(d, a, c), be_high = hn::InterleaveUpper(d, b, e);
    return {hn::InterleaveLower(d, ac_low, be_low), hn::InterleaveUpper(d, ac_low, be_low),
            hn::InterleaveLower(d, ac_high, be_high), hn::InterleaveUpper(d, ac_high, be_high)};
#endif
}

// Away from 0, so that its inverse is finite: a ray along an axis strays by 1e-8 cell a cell.
HWY_INLINE VF away_from_zero(VF x) {
    const D d;
    const VF least = hn::Set(d, 1e-8f);
    return hn::IfThenElse(hn::Lt(hn::Abs(x), least), hn::CopySign(least, x), x);
}

// i modulo n, for |i| far below 2^24.
HWY_INLINE VI wrap(VI i, float n, float inverse_n) {
    const D d;
    const DI di;
    const VF whole =
        hn::Floor(hn::Mul(hn::Add(hn::ConvertTo(d, i), hn::Set(d, 0.5f)), hn::Set(d, inverse_n)));
    return hn::Sub(i, hn::ConvertTo(di, hn::Mul(whole, hn::Set(d, n))));
}

// Walks `steps` cells or jumps with the rays at `at`; sorts them into rays (front, compacted), hits and
// escaped.
HWY_INLINE void walk(const TraceGrid& grid, RayBatch& rays, size_t at, size_t count, int steps,
                     bool far_at_once, RayBatch& hits, RayBatch& escaped) {
    const D d;
    const DI di;
    const VF zero = hn::Zero(d), one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
    const VI one_i = hn::Set(di, 1), nx = hn::Set(di, grid.nx), ny = hn::Set(di, grid.ny);
    const float inverse_nx = 1.0f / static_cast<float>(grid.nx),
                inverse_ny = 1.0f / static_cast<float>(grid.ny);
    const VF top = hn::Set(d, grid.highest), below = hn::Set(d, -grid.hit_tolerance);
    Rays r = load(rays, at);
    const VF dx = away_from_zero(r.dx), dy = away_from_zero(r.dy), dz = r.dz;
    const VF per_cell = hn::Div(one, hn::Max(hn::Abs(dx), hn::Abs(dy)));
    const VF near = hn::Mul(per_cell, hn::Set(d, static_cast<float>(jump_cells[0]))),
             far = hn::Mul(per_cell, hn::Set(d, static_cast<float>(jump_cells[1])));
    // A ray that falls may jump as far as it stays above what is highest around it; less than two cells are
    // not worth it.
    const VF shortest = hn::Add(per_cell, per_cell), falls_shortest = hn::Min(zero, hn::Mul(dz, shortest)),
             per_fall = hn::Div(hn::Set(d, -1.0f), hn::Min(dz, hn::Set(d, -1e-20f)));
    const auto until = [&](VF height, VF limit)
                           HWY_ATTR { return hn::Min(limit, hn::Mul(hn::Sub(r.z, height), per_fall)); };
    const VF inverse_x = hn::Div(one, dx), inverse_y = hn::Div(one, dy),
             inverse_d = hn::Div(one, away_from_zero(hn::Sub(dx, dy)));
    const M right = hn::Gt(dx, zero), up = hn::Gt(dy, zero), rising = hn::Gt(dz, zero);
    const VF exit_u = hn::IfThenElseZero(right, one), exit_v = hn::IfThenElseZero(up, one);
    const M nothing = hn::Lt(zero, zero);
    M active = hn::FirstN(d, count), hit = nothing, gone = nothing, upper_hit = nothing;
    for (int step = 0; step < steps; ++step) {
        const M over = hn::And(active, hn::And(rising, hn::Ge(r.z, top)));
        gone = hn::Or(gone, over);
        active = hn::AndNot(over, active);
        if (hn::AllFalse(d, active)) break;
        const VI cell = hn::Add(hn::Mul(r.j, nx), r.i);

        const VF near_top = hn::GatherIndex(d, grid.highest_near[0].data(), cell);
        const M jump = hn::And(active, hn::Gt(hn::Add(r.z, falls_shortest), near_top));
        if (!hn::AllFalse(d, jump)) {
            VF length = until(near_top, near);
            if (far_at_once || step > 0)
                length = hn::Max(length, until(hn::GatherIndex(d, grid.highest_near[1].data(), cell), far));
            length = hn::IfThenElseZero(jump, length);
            r.z = hn::MulAdd(dz, length, r.z);
            const VF u = hn::MulAdd(dx, length, r.u), v = hn::MulAdd(dy, length, r.v);
            const VF column = hn::IfThenElseZero(jump, hn::Floor(u)),
                     row = hn::IfThenElseZero(jump, hn::Floor(v));
            r.u = hn::Sub(u, column);
            r.v = hn::Sub(v, row);
            r.i = wrap(hn::Add(r.i, hn::ConvertTo(di, column)), static_cast<float>(grid.nx), inverse_nx);
            r.j = wrap(hn::Add(r.j, hn::ConvertTo(di, row)), static_cast<float>(grid.ny), inverse_ny);
        }
        M walking = hn::AndNot(jump, active);
        if (hn::AllFalse(d, walking)) continue;

        const auto [h00, h10, h01, h11] = corners_of(grid, cell);
        const auto plane = [&, h00 = h00, h10 = h10, h01 = h01, h11 = h11](M upper, VF u, VF v) {
            const VF gradient_u = hn::IfThenElse(upper, hn::Sub(h11, h01), hn::Sub(h10, h00));
            const VF gradient_v = hn::IfThenElse(upper, hn::Sub(h01, h00), hn::Sub(h11, h10));
            return hn::MulAdd(gradient_u, u, hn::MulAdd(gradient_v, v, h00));
        };
        const VF to_x = hn::Mul(hn::Sub(exit_u, r.u), inverse_x),
                 to_y = hn::Mul(hn::Sub(exit_v, r.v), inverse_y);
        const VF to_exit = hn::Max(zero, hn::Min(to_x, to_y));
        const M exits_x = hn::Le(to_x, to_y);
        const VF to_diagonal = hn::Mul(hn::Sub(r.v, r.u), inverse_d);
        const M crosses = hn::And(walking, hn::And(hn::Gt(to_diagonal, zero), hn::Lt(to_diagonal, to_exit)));
        const VF diagonal_u = hn::MulAdd(dx, to_diagonal, r.u);
        const VF gap_diagonal =
            hn::Sub(hn::MulAdd(dz, to_diagonal, r.z), hn::MulAdd(hn::Sub(h11, h00), diagonal_u, h00));
        const VF end_u = hn::IfThenElse(exits_x, exit_u, hn::MulAdd(dx, to_exit, r.u)),
                 end_v = hn::IfThenElse(exits_x, hn::MulAdd(dy, to_exit, r.v), exit_v),
                 end_z = hn::MulAdd(dz, to_exit, r.z);
        const VF gap_exit = hn::Sub(end_z, plane(hn::Lt(end_u, end_v), end_u, end_v));
        const M before = hn::And(crosses, hn::Lt(gap_diagonal, below)),
                behind = hn::And(hn::AndNot(before, walking), hn::Lt(gap_exit, below));
        const M met = hn::Or(before, behind);
        if (!hn::AllFalse(d, met)) {
            const M second = hn::And(behind, crosses);
            const VF gap_start = hn::Sub(r.z, plane(hn::Lt(r.u, r.v), r.u, r.v));
            const VF t_a = hn::IfThenElseZero(second, to_diagonal),
                     gap_a = hn::Max(zero, hn::IfThenElse(second, gap_diagonal, gap_start)),
                     t_b = hn::IfThenElse(before, to_diagonal, to_exit),
                     gap_b = hn::IfThenElse(before, gap_diagonal, gap_exit);
            const VF t = hn::MulAdd(hn::Sub(t_b, t_a), hn::Div(gap_a, hn::Sub(gap_a, gap_b)), t_a);
            const VF middle = hn::Mul(half, hn::Add(t_a, t_b));
            const M upper = hn::Lt(hn::MulAdd(dx, middle, r.u), hn::MulAdd(dy, middle, r.v));
            upper_hit = hn::Or(upper_hit, hn::And(met, upper));
            const VF u = hn::Min(one, hn::Max(zero, hn::MulAdd(dx, t, r.u))),
                     v = hn::Min(one, hn::Max(zero, hn::MulAdd(dy, t, r.v)));
            r.z = hn::IfThenElse(met, plane(upper, u, v), r.z);
            r.u = hn::IfThenElse(met, u, r.u);
            r.v = hn::IfThenElse(met, v, r.v);
            hit = hn::Or(hit, met);
            active = hn::AndNot(met, active);
            walking = hn::AndNot(met, walking);
        }
        // Into the next cell.
        const M over_x = hn::And(walking, exits_x), over_y = hn::AndNot(exits_x, walking);
        r.u = hn::IfThenElse(walking, hn::IfThenElse(exits_x, hn::Sub(one, end_u), end_u), r.u);
        r.v = hn::IfThenElse(walking, hn::IfThenElse(exits_x, end_v, hn::Sub(one, end_v)), r.v);
        r.z = hn::IfThenElse(walking, end_z, r.z);
        const VI sign_x = hn::IfThenElse(hn::RebindMask(di, right), one_i, hn::Set(di, -1)),
                 sign_y = hn::IfThenElse(hn::RebindMask(di, up), one_i, hn::Set(di, -1));
        r.i = hn::Add(r.i, hn::IfThenElseZero(hn::RebindMask(di, over_x), sign_x));
        r.j = hn::Add(r.j, hn::IfThenElseZero(hn::RebindMask(di, over_y), sign_y));
        r.i = hn::IfThenElse(hn::Lt(r.i, hn::Zero(di)), hn::Sub(nx, one_i), r.i);
        r.j = hn::IfThenElse(hn::Lt(r.j, hn::Zero(di)), hn::Sub(ny, one_i), r.j);
        r.i = hn::IfThenZeroElse(hn::Eq(r.i, nx), r.i);
        r.j = hn::IfThenZeroElse(hn::Eq(r.j, ny), r.j);
    }
    if (!hn::AllFalse(d, hit)) {
        const VI kind = hn::IfThenElseZero(hn::RebindMask(di, upper_hit), one_i);
        hn::StoreU(Packing(hit)(kind), di, &hits.kind[hits.n]);
        append(r, hit, hits);
    }
    if (!hn::AllFalse(d, gone)) append(r, gone, escaped);
    append(r, active, rays);
}

void trace(const TraceGrid& grid, RayBatch& rays, RayBatch& hits, RayBatch& escaped, int max_steps) {
    const size_t lanes = hn::Lanes(D());
    // Short rounds first: most rays are done after few cells.
    for (int round = 0, taken = 0; rays.n > 0 && taken < max_steps; ++round) {
        const int steps = round == 0 ? 6 : round == 1 ? 8 : 16;
        const size_t n = rays.n;
        rays.n = 0;
        for (size_t at = 0; at < n; at += lanes)
            walk(grid, rays, at, std::min(lanes, n - at), steps, round > 0, hits, escaped);
        taken += steps;
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
namespace {

HWY_EXPORT(trace);

// Maximum over the nodes [-radius, radius + 1] around each, along lines of `length` nodes that are `step`
// apart.
void sliding_max(const std::vector<float>& from, int length, int step, int n_lines, int line_step, int radius,
                 std::vector<float>& to) {
    const int reach = std::min(2 * radius + 2, length);
    std::vector<float> a(length), b(length);
    for (int line = 0; line < n_lines; ++line) {
        const size_t first = static_cast<size_t>(line) * line_step;
        for (int k = 0; k < length; ++k) a[k] = from[first + static_cast<size_t>(k) * step];
        auto widen = [&](int shift) {
            for (int k = 0; k < length; ++k) b[k] = std::max(a[k], a[(k + shift) % length]);
            a.swap(b);
        };
        int covered = 1;
        for (; 2 * covered <= reach; covered *= 2) widen(covered);
        if (covered < reach) widen(reach - covered);
        for (int k = 0; k < length; ++k)
            to[first + static_cast<size_t>(k) * step] =
                a[wrap_index(static_cast<long long>(k) - radius, length)];
    }
}

}  // namespace

void RayBatch::reserve(size_t capacity) {
    for (std::vector<int32_t>* a : {&i, &j, &id, &kind}) a->resize(capacity + padding);
    for (std::vector<float>* a : {&u, &v, &z, &dx, &dy, &dz}) a->resize(capacity + padding);
}

TraceGrid make_trace_grid(const HeightField& surface) {
    const int nx = surface.nx, ny = surface.ny;
    const size_t cells = static_cast<size_t>(nx) * ny;
    if (cells > size_t{1} << 28)
        throw Error(ErrorCode::limit, "/surface", std::to_string(nx) + " x " + std::to_string(ny),
                    "forward transport traces at most 2^28 cells");
    TraceGrid grid;
    grid.nx = nx;
    grid.ny = ny;
    grid.aspect = surface.pitch_x / surface.pitch_y;
    std::vector<float> nodes(cells);
    for (size_t k = 0; k < cells; ++k)
        nodes[k] = static_cast<float>(static_cast<double>(surface.heights[k]) / surface.pitch_x);
    const auto [low, high] = std::minmax_element(nodes.begin(), nodes.end());
    grid.lowest = *low;
    grid.highest = *high;
    grid.hit_tolerance = 1e-6f * (*high - *low);
    grid.corners.resize(4 * cells);
    for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i) {
            const int right = i + 1 == nx ? 0 : i + 1, up = j + 1 == ny ? 0 : j + 1;
            float* corner = &grid.corners[4 * (static_cast<size_t>(j) * nx + i)];
            corner[0] = nodes[static_cast<size_t>(j) * nx + i];
            corner[1] = nodes[static_cast<size_t>(j) * nx + right];
            corner[2] = nodes[static_cast<size_t>(up) * nx + i];
            corner[3] = nodes[static_cast<size_t>(up) * nx + right];
        }
    std::vector<float> along_x(cells);
    for (int k = 0; k < 2; ++k) {
        sliding_max(nodes, nx, 1, ny, nx, jump_cells[k], along_x);
        grid.highest_near[k].resize(cells);
        sliding_max(along_x, ny, nx, nx, 1, jump_cells[k], grid.highest_near[k]);
    }
    return grid;
}

float facet_height(const TraceGrid& grid, int kind, int i, int j, float u, float v) {
    const float* h = &grid.corners[4 * (static_cast<size_t>(j) * grid.nx + i)];
    return kind == 0 ? h[0] + (h[1] - h[0]) * u + (h[3] - h[1]) * v
                     : h[0] + (h[3] - h[2]) * u + (h[2] - h[0]) * v;
}

size_t trace_rays(const TraceGrid& grid, RayBatch& rays, RayBatch& hits, RayBatch& escaped,
                  std::vector<int32_t>& lost, int max_steps) {
    hits.n = escaped.n = 0;
    HWY_DYNAMIC_DISPATCH(trace)(grid, rays, hits, escaped, max_steps);
    lost.assign(rays.id.begin(), rays.id.begin() + static_cast<long>(rays.n));
    rays.n = 0;
    return lost.size();
}

}  // namespace gonio
#endif  // HWY_ONCE
