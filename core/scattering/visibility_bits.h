// Which facets a direction lights or sees, one bit a sub-sample: what the exact lobes of flat facets are
// multiplied with, and the mean visible cosines from which the transport starts.
#pragma once
#include <vector>

#include "base/huge_pages.h"
#include "base/monitor.h"
#include "scattering/irradiance.h"
#include "scattering/tile.h"

namespace gonio {

inline constexpr int most_bits = 32;  // sub-samples that fit one word

// bits[direction * n_unknowns + unknown], bit s: sub-sample s of the part sees along the direction. Bits of
// directions steeper than the relief are set on facets that face away, too: the cosine knows that.
struct VisibilityBits {
    std::vector<uint32_t, HugePageAllocator<uint32_t>> bits;
    size_t n_unknowns = 0;
    int n_sub_samples = most_bits;  // bits in use
    double rays = 0, rays_skipped = 0;
    int truncated_bundles = 0;

    const uint32_t* of(int direction) const { return bits.data() + direction * n_unknowns; }
};

// At most most_bits sub-samples.
VisibilityBits find_visibility(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& directions,
                               const std::vector<SubSample>& sub_samples, bool skip_steep, int n_threads,
                               const Monitor& monitor);

// Mean over the sub-samples of max(0, <n, d>) V, [unknown][stride], stride = n_directions padded with zeros
// to a multiple of 16.
struct VisibleCosines {
    HugeFloats values;
    size_t stride = 0;

    const float* of(size_t unknown) const { return values.data() + unknown * stride; }
};

// visible.values += share * cosine * number of bits set; allocates at the first call. Deterministic.
void add_cosines(const Tile& tile, const std::vector<Vec3>& directions, const VisibilityBits& bits,
                 double share, int n_threads, VisibleCosines& visible);

// Sum over the core of area <n,d>+ V, per direction, in units of pitch_x * pitch_y.
std::vector<double> projected_areas(const Tile& tile, const VisibleCosines& visible, int n_directions);

// Areas of parts, per slot; 0 outside the core.
std::vector<float> core_areas(const Tile& tile);

}  // namespace gonio
