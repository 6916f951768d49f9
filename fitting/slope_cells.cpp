#include "fitting/slope_cells.h"

#include <bit>
#include <cstdint>

namespace gonio {
namespace {

// Sign, 11 bits of exponent and the first three of the mantissa.
constexpr int size_shift = 49;
constexpr size_t size_bins = 1u << (64 - size_shift);

// Bins along one axis: `fine` even ones up to t = 1, then `fine` a factor of two. A logarithm would do the
// same at thirty times the cost: the leading bits of a double are its logarithm.
class AxisBins {
  public:
    AxisBins(double scale, double largest) : inverse_scale_(1 / scale) {
        // Steep outliers cost octaves; then fewer bins an octave, so that all of them stay below a million.
        const int octaves = largest > scale ? std::ilogb(largest / scale) + 1 : 0;
        while (log2_fine_ > 3 && ((octaves + 1) << log2_fine_) > 512) --log2_fine_;
        half_ = (octaves + 1) << log2_fine_;
    }
    int half() const { return half_; }
    // In [-half, half - 1].
    int operator()(double slope) const {
        const double t = std::abs(slope) * inverse_scale_;
        int k;
        if (t < 1) {
            k = static_cast<int>(t * (1 << log2_fine_));
        } else {
            constexpr uint64_t one = std::bit_cast<uint64_t>(1.0);
            k = (1 << log2_fine_) + static_cast<int>((std::bit_cast<uint64_t>(t) - one) >> (52 - log2_fine_));
        }
        k = std::min(k, half_ - 1);
        return slope < 0 ? -1 - k : k;
    }

  private:
    double inverse_scale_;
    int log2_fine_ = 6, half_ = 0;
};

}  // namespace

SlopeSums sum_slopes(const HeightField& surface) {
    SlopeSums sums;
    sums.by_size.assign(size_bins, 0);
    double largest = 0;
    for_each_facet(surface, [&](const Gradient& g) {
        const double size = g.x * g.x + g.y * g.y;
        sums.mean_x += g.x;
        sums.mean_y += g.y;
        sums.xx += g.x * g.x;
        sums.xy += g.x * g.y;
        sums.yy += g.y * g.y;
        largest = std::max(largest, size);
        ++sums.by_size[std::bit_cast<uint64_t>(size) >> size_shift];
        ++sums.n;
        sums.n_level += size == 0;
    });
    sums.max_slope = std::sqrt(largest);
    for (double* sum : {&sums.mean_x, &sums.mean_y, &sums.xx, &sums.xy, &sums.yy})
        if (sums.n > 0) *sum /= static_cast<double>(sums.n);
    return sums;
}

double slope_quantile(const SlopeSums& sums, double u, bool without_level) {
    const long long skipped = without_level ? sums.n_level : 0;
    const double wanted = static_cast<double>(skipped) + u * static_cast<double>(sums.n - skipped);
    double below = 0;
    for (size_t k = 0; k < sums.by_size.size(); ++k) {
        below += static_cast<double>(sums.by_size[k]);
        if (below < wanted || below <= static_cast<double>(skipped)) continue;
        return std::sqrt(std::bit_cast<double>((static_cast<uint64_t>(k) + 1) << size_shift));
    }
    return sums.max_slope;
}

std::vector<SlopeCell> gather_cells(const HeightField& surface, const SlopeSums& sums) {
    if (sums.max_slope == 0) return {{static_cast<double>(sums.n), 0, 0, 0}};
    const AxisBins bin(slope_quantile(sums, 0.5, true), sums.max_slope);
    const int width = 2 * bin.half();
    std::vector<SlopeCell> grid(static_cast<size_t>(bin.half()) * width);
    for_each_facet(surface, [&](const Gradient& g) {
        // The models are even: (p, q) and (-p, -q) share a cell.
        const int x = bin(g.x), y = x < 0 ? bin(-g.y) : bin(g.y);
        SlopeCell& cell = grid[static_cast<size_t>(x < 0 ? -1 - x : x) * width + (y + bin.half())];
        cell.count += 1;
        cell.xx += g.x * g.x;
        cell.xy += g.x * g.y;
        cell.yy += g.y * g.y;
    });
    std::vector<SlopeCell> cells;
    for (const SlopeCell& cell : grid)
        if (cell.count > 0)
            cells.push_back({cell.count, cell.xx / cell.count, cell.xy / cell.count, cell.yy / cell.count});
    return cells;
}

}  // namespace gonio
