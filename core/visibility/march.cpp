// Kernels of the lockstep march; this file is compiled once for every instruction set (Highway's
// foreach_target).
#include "visibility/march.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "base/bits.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "visibility/march.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gonio {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::ScalableTag<float>;
using DI = hn::RebindToSigned<D>;
using VF = hn::Vec<D>;
using VI = hn::Vec<DI>;
using M = hn::Mask<D>;

// Vectors that march together: enough for the latency of the fused multiply-adds and to share what is looked
// up of a crossing, few enough to stop early and to stay in registers.
#if HWY_TARGET <= HWY_AVX3
constexpr int together = 2;
#else
constexpr int together = 4;
#endif

struct Block {
    const MarchPlane* plane;
    const RayBundle* bundle;
    float highest;
    int row, column;  // of the block's first lane; lanes beyond nx read the padding
    int lane;         // first lane inside the 32
};

HWY_INLINE const float* node_at(const MarchPlane& plane, const std::vector<float>& nodes, const Block& b,
                                int column, int row) {
    int r = b.row + row, c = b.column + column;
    r -= r >= plane.ny ? plane.ny : 0;
    c -= c >= plane.nx ? plane.nx : 0;
    return nodes.data() + static_cast<size_t>(r) * plane.stride + c + b.lane;
}

// Height of the start points, and which rays are of the bundle and leave the front of their facet.
HWY_INLINE void start_rays(const Block& b, int offset, VF& height, M& front) {
    const D d;
    const MarchPlane& plane = *b.plane;
    const RayBundle& bundle = *b.bundle;
    if (bundle.from_above) {
        height = hn::Set(d, bundle.start_height);
        front = hn::FirstN(d, hn::Lanes(d));
        return;
    }
    const float* p =
        plane.heights.data() + static_cast<size_t>(b.row) * plane.stride + b.column + b.lane + offset;
    const VF h00 = hn::LoadU(d, p), h10 = hn::LoadU(d, p + 1), h01 = hn::LoadU(d, p + plane.stride),
             h11 = hn::LoadU(d, p + plane.stride + 1);
    const bool lower = bundle.start.kind == 0;
    const VF own = lower ? h10 : h01;
    const VF gradient_x = lower ? hn::Sub(h10, h00) : hn::Sub(h11, h01);
    const VF gradient_y = lower ? hn::Sub(h11, h10) : hn::Sub(h01, h00);
    height = hn::MulAdd(h00, hn::Set(d, bundle.start_weight[0]),
                        hn::MulAdd(own, hn::Set(d, bundle.start_weight[1]),
                                   hn::Mul(h11, hn::Set(d, bundle.start_weight[2]))));
    VF rise = hn::Set(d, static_cast<float>(bundle.direction.rise));
    if (bundle.bent) rise = hn::MulAdd(hn::Mul(rise, hn::Set(d, bundle.kappa)), height, rise);
    const VF facing =
        hn::NegMulAdd(gradient_x, hn::Set(d, static_cast<float>(bundle.path.step_u)),
                      hn::NegMulAdd(gradient_y, hn::Set(d, static_cast<float>(bundle.path.step_v)), rise));
    front = hn::Gt(facing, hn::Zero(d));
    if (!bundle.heights.all())
        front = hn::And(front, hn::And(hn::Ge(height, hn::Set(d, bundle.heights.from)),
                                       hn::Lt(height, hn::Set(d, bundle.heights.below))));
}

HWY_INLINE uint32_t mask_bits(M mask) {
    uint8_t bytes[8] = {};
    hn::StoreMaskBits(D(), mask, bytes);
    uint32_t bits;
    std::memcpy(&bits, bytes, 4);
    return bits;
}

// Marches `together` vectors of rays; returns front and hit lanes as bits and, where asked, the crossing
// behind each hit. kBent: as bundle.bent.
template <bool kWantCrossing, bool kBent>
HWY_INLINE void march_together(const Block& b, uint32_t& front_bits, uint32_t& hit_bits, int32_t* crossing) {
    const D d;
    const DI di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const MarchPlane& plane = *b.plane;
    const RayBundle& bundle = *b.bundle;
    const bool rising = bundle.direction.rise > 0;
    VF height[together];
    M front[together], active[together];
    VI at[together];
    for (int v = 0; v < together; ++v) {
        start_rays(b, v * lanes, height[v], front[v]);
        active[v] = front[v];
        at[v] = hn::Zero(di);
    }
    const VF top = hn::Set(d, b.highest);
    auto none = [&](auto&& of_vector) HWY_ATTR {
        M any = of_vector(0);
        for (int v = 1; v < together; ++v) any = hn::Or(any, of_vector(v));
        return hn::AllFalse(d, any);
    };
    auto none_left = [&]() HWY_ATTR { return none([&](int v) HWY_ATTR { return active[v]; }); };
    // Whether `limit` is above no ray.
    auto none_below = [&](VF limit) HWY_ATTR {
        return none([&](int v) HWY_ATTR { return hn::And(active[v], hn::Gt(limit, height[v])); });
    };

    if (!none_left()) {
        // Crossing 0 is the edge of the ray's own facet, which only a ray from above can hit.
        int k = bundle.from_above ? 0 : 1;
        for (const CrossingGroup& group : bundle.groups) {
            if (group.window >= 0) {
                const float* w = node_at(plane, plane.window_max[group.window], b, group.column, group.row);
                const VF rise = hn::Set(d, group.lowest_rise);
                bool passes_over;
                if constexpr (kBent) {
                    if (none_below(hn::Set(d, bundle.escape[k]))) break;
                    const VF scale = hn::Set(d, group.scale);
                    passes_over = none([&](int v) HWY_ATTR {
                        const VF edge = hn::MulSub(hn::LoadU(d, w + v * lanes), scale, rise);
                        return hn::And(active[v], hn::Gt(edge, height[v]));
                    });
                } else {
                    VF ray[together];
                    for (int v = 0; v < together; ++v) ray[v] = hn::Add(height[v], rise);
                    if (rising &&
                        none([&](int v) HWY_ATTR { return hn::And(active[v], hn::Gt(top, ray[v])); }))
                        break;
                    passes_over = none([&](int v) HWY_ATTR {
                        return hn::And(active[v], hn::Gt(hn::LoadU(d, w + v * lanes), ray[v]));
                    });
                }
                if (passes_over) {
                    k = group.end;
                    continue;
                }
            }
            bool done = false;
            for (; k < group.end; ++k) {
                const Crossing& c = bundle.crossings[k];
                const float* p = node_at(plane, plane.heights, b, c.column, c.row);
                const float* q = p + c.second_node;
                const VF w0 = hn::Set(d, c.weight0), w1 = hn::Set(d, c.weight1), rise = hn::Set(d, c.rise);
                for (int v = 0; v < together; ++v) {
                    VF edge = hn::MulAdd(hn::LoadU(d, q + v * lanes), w1,
                                         hn::MulSub(hn::LoadU(d, p + v * lanes), w0, rise));
                    if constexpr (kBent) edge = hn::Min(edge, hn::Set(d, bundle.escape[k]));
                    const M above = hn::Gt(edge, height[v]);
                    if constexpr (kWantCrossing)
                        at[v] = hn::IfThenElse(hn::RebindMask(di, hn::And(active[v], above)), hn::Set(di, k),
                                               at[v]);
                    active[v] = hn::AndNot(above, active[v]);
                }
                if (none_left()) {
                    done = true;
                    break;
                }
                if ((kBent || rising) && (k & 7) == 7 &&
                    none_below(kBent ? hn::Set(d, bundle.escape[k]) : hn::Sub(top, rise))) {
                    done = true;
                    break;
                }
            }
            if (done) break;
        }
    }
    front_bits = hit_bits = 0;
    for (int v = 0; v < together; ++v) {
        const uint32_t starts = mask_bits(front[v]) << v * lanes;
        front_bits |= starts;
        hit_bits |= starts & ~(mask_bits(active[v]) << v * lanes);
        if constexpr (kWantCrossing) hn::StoreU(at[v], di, crossing + v * lanes);
    }
}

template <bool kWantCrossing>
HWY_INLINE void march_block_of(const Block& b, uint32_t& front, uint32_t& hit, int32_t* crossing) {
    if (b.bundle->bent)
        march_together<kWantCrossing, true>(b, front, hit, crossing);
    else
        march_together<kWantCrossing, false>(b, front, hit, crossing);
}

HWY_INLINE uint32_t tail_mask(int width, int word) {
    const int left = width - word * march_block;
    return left >= march_block ? ~0u : (1u << left) - 1;
}

void march_lines(const MarchPlane& plane, const RayBundle& bundle, float highest, int column, int row,
                 int width, int n_lines, uint32_t* front, uint32_t* hit, int32_t* crossing) {
    const int step = together * static_cast<int>(hn::Lanes(D())), words = words_for(width);
    for (int line = 0; line < n_lines; ++line)
        for (int word = 0; word < words; ++word) {
            Block b{
                &plane, &bundle, highest, (row + line) % plane.ny, (column + word * march_block) % plane.nx,
                0};
            uint32_t all_front = 0, all_hit = 0;
            const size_t at = static_cast<size_t>(line) * words + word;
            for (; b.lane < march_block; b.lane += step) {
                uint32_t f, h;
                if (crossing)
                    march_block_of<true>(b, f, h, crossing + at * march_block + b.lane);
                else
                    march_block_of<false>(b, f, h, nullptr);
                all_front |= f << b.lane;
                all_hit |= h << b.lane;
            }
            front[at] = all_front & tail_mask(width, word);
            hit[at] = all_hit & tail_mask(width, word);
        }
}

template <bool kWantTravel>
void horizon_lines(const MarchPlane& plane, const RayBundle& bundle, float highest, int column, int row,
                   int width, int n_lines, float* slope, float* travel) {
    const D d;
    const int lanes = static_cast<int>(hn::Lanes(d)), words = words_for(width);
    const VF top = hn::Set(d, highest);
    for (int line = 0; line < n_lines; ++line)
        for (int word = 0; word < words; ++word) {
            Block b{
                &plane, &bundle, highest, (row + line) % plane.ny, (column + word * march_block) % plane.nx,
                0};
            for (; b.lane < march_block; b.lane += lanes) {
                VF height, best = hn::Zero(d), best_travel = hn::Zero(d);
                M front;
                start_rays(b, 0, height, front);
                const VF headroom = hn::Sub(top, height);
                int k = 0;
                for (const CrossingGroup& group : bundle.groups) {
                    const VF inverse = hn::Set(d, 1 / bundle.facets[k].travel);
                    if (hn::AllFalse(d, hn::Gt(hn::Mul(headroom, inverse), best))) break;
                    if (group.window >= 0) {
                        const float* w =
                            node_at(plane, plane.window_max[group.window], b, group.column, group.row);
                        if (hn::AllFalse(d,
                                         hn::Gt(hn::Mul(hn::Sub(hn::LoadU(d, w), height), inverse), best))) {
                            k = group.end;
                            continue;
                        }
                    }
                    for (; k < group.end; ++k) {
                        const Crossing& c = bundle.crossings[k];
                        const float* p = node_at(plane, plane.heights, b, c.column, c.row);
                        const VF edge = hn::MulAdd(hn::LoadU(d, p + c.second_node), hn::Set(d, c.weight1),
                                                   hn::Mul(hn::LoadU(d, p), hn::Set(d, c.weight0)));
                        const VF seen =
                            hn::Mul(hn::Sub(edge, height), hn::Set(d, 1 / bundle.facets[k].travel));
                        if constexpr (kWantTravel)
                            best_travel = hn::IfThenElse(hn::Gt(seen, best),
                                                         hn::Set(d, bundle.facets[k].travel), best_travel);
                        best = hn::Max(best, seen);
                    }
                }
                const size_t to = (static_cast<size_t>(line) * words + word) * march_block + b.lane;
                hn::StoreU(best, d, slope + to);
                if constexpr (kWantTravel) hn::StoreU(best_travel, d, travel + to);
            }
        }
}

void horizon_slopes(const MarchPlane& plane, const RayBundle& bundle, float highest, int column, int row,
                    int width, int n_lines, float* slope, float* travel) {
    if (travel)
        horizon_lines<true>(plane, bundle, highest, column, row, width, n_lines, slope, travel);
    else
        horizon_lines<false>(plane, bundle, highest, column, row, width, n_lines, slope, nullptr);
}

}  // namespace HWY_NAMESPACE
}  // namespace gonio
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gonio {
namespace {

HWY_EXPORT(march_lines);
HWY_EXPORT(horizon_slopes);

const MarchPlane& plane_of(const MarchGrid& grid, const RayBundle& bundle) {
    return bundle.transposed ? grid.transposed : grid.rows;
}

}  // namespace

void march_visible(const MarchGrid& grid, const RayBundle& bundle, const CellRect& rect, uint32_t* visible) {
    const MarchPlane& plane = plane_of(grid, bundle);
    const int words = words_for(rect.width);
    if (!bundle.transposed) {
        std::vector<uint32_t> hit(static_cast<size_t>(words) * rect.height);
        HWY_DYNAMIC_DISPATCH(march_lines)
        (plane, bundle, grid.highest, rect.x0, rect.y0, rect.width, rect.height, visible, hit.data(),
         nullptr);
        for (size_t k = 0; k < hit.size(); ++k) visible[k] &= ~hit[k];
        return;
    }
    const int turned_words = words_for(rect.height);
    std::vector<uint32_t> front(static_cast<size_t>(turned_words) * rect.width), hit(front.size());
    HWY_DYNAMIC_DISPATCH(march_lines)
    (plane, bundle, grid.highest, rect.y0, rect.x0, rect.height, rect.width, front.data(), hit.data(),
     nullptr);
    uint32_t square[32];
    for (int word = 0; word < words; ++word)
        for (int turned = 0; turned < turned_words; ++turned) {
            const int columns = std::min(march_block, rect.width - word * march_block);
            const int rows = std::min(march_block, rect.height - turned * march_block);
            for (int c = 0; c < march_block; ++c) {
                const size_t at = static_cast<size_t>(word * march_block + c) * turned_words + turned;
                square[c] = c < columns ? front[at] & ~hit[at] : 0;
            }
            transpose_bits(square);
            for (int r = 0; r < rows; ++r)
                visible[static_cast<size_t>(turned * march_block + r) * words + word] = square[r];
        }
}

bool visible_along(const MarchGrid& grid, const Vec3& direction, const FacetPoint& start, double max_travel,
                   const CellRect& rect, uint32_t* visible) {
    const std::vector<StartHeights> layers = start_heights(grid, direction);
    bool truncated = false;
    std::vector<uint32_t> of_layer(
        layers.size() > 1 ? static_cast<size_t>(words_for(rect.width)) * rect.height : 0);
    for (size_t k = 0; k < layers.size(); ++k) {
        const RayBundle bundle = make_ray_bundle(grid, direction, start, max_travel, layers[k]);
        march_visible(grid, bundle, rect, k == 0 ? visible : of_layer.data());
        for (size_t word = 0; k > 0 && word < of_layer.size(); ++word) visible[word] |= of_layer[word];
        truncated = truncated || bundle.truncated;
    }
    return truncated;
}

void march_hits(const MarchGrid& grid, const RayBundle& bundle, int column, int row, int width, int n_lines,
                HitLines& out) {
    const size_t words = static_cast<size_t>(words_for(width)) * n_lines;
    out.front.resize(words);
    out.hit.resize(words);
    out.crossing.resize(words * march_block);
    HWY_DYNAMIC_DISPATCH(march_lines)
    (plane_of(grid, bundle), bundle, grid.highest, column, row, width, n_lines, out.front.data(),
     out.hit.data(), out.crossing.data());
}

void march_horizon(const MarchGrid& grid, const RayBundle& bundle, const CellRect& rect, float* horizon_slope,
                   float* horizon_distance) {
    const int lines = bundle.transposed ? rect.width : rect.height,
              length = bundle.transposed ? rect.height : rect.width;
    const int padded = words_for(length) * march_block;
    std::vector<float> slope(static_cast<size_t>(lines) * padded),
        travel(horizon_distance ? slope.size() : 0);
    HWY_DYNAMIC_DISPATCH(horizon_slopes)
    (plane_of(grid, bundle), bundle, grid.highest, bundle.transposed ? rect.y0 : rect.x0,
     bundle.transposed ? rect.x0 : rect.y0, length, lines, slope.data(),
     horizon_distance ? travel.data() : nullptr);
    // Heights are in pitch_x and travel in cells: a cell of travel is hypot(pitch_x step_x, pitch_y step_y)
    // long.
    const double step_x = bundle.transposed ? bundle.direction.step_y : bundle.direction.step_x;
    const double step_y = bundle.transposed ? bundle.direction.step_x : bundle.direction.step_y;
    const double cell = std::hypot(step_x * grid.pitch_x, step_y * grid.pitch_y);
    auto place = [&](const std::vector<float>& from, float unit, float* to) {
        for (int r = 0; r < rect.height; ++r)
            for (int c = 0; c < rect.width; ++c)
                to[static_cast<size_t>(r) * rect.width + c] =
                    unit * from[bundle.transposed ? static_cast<size_t>(c) * padded + r
                                                  : static_cast<size_t>(r) * padded + c];
    };
    place(slope, static_cast<float>(grid.pitch_x / cell), horizon_slope);
    if (horizon_distance) place(travel, static_cast<float>(cell), horizon_distance);
}

const char* simd_target() {
    const int64_t supported = hwy::SupportedTargets() & HWY_TARGETS;
    return hwy::TargetName(supported & -supported);  // the lowest bit is the best target
}

bool force_simd_target(const char* name) {
    hwy::SetSupportedTargetsForTest(0);
    if (std::string(name).empty()) {
        hwy::GetChosenTarget().DeInit();
        return true;
    }
    for (int64_t left = hwy::SupportedTargets() & HWY_TARGETS; left != 0; left &= left - 1) {
        const int64_t target = left & -left;
        if (std::string(name) != hwy::TargetName(target)) continue;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().DeInit();
        return true;
    }
    return false;
}

}  // namespace gonio
#endif  // HWY_ONCE
