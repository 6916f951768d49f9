#include "surface/statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <tuple>

#include "base/text.h"
#include "surface/facet_mesh.h"

namespace gonio {
namespace {

// Every step between neighbours along x (or y) is an edge of one facet of either kind, so a mean over steps
// is the mean over facets weighted by base area. An open surface has no step across its seam.
struct Steps {
    std::vector<double>
        mean_square;  // of the n steps k -> k + 1 (the last crosses the seam), over the other axis; metres^2
    double rms_inside() const {
        double sum = 0;
        for (size_t k = 0; k + 1 < mean_square.size(); ++k) sum += mean_square[k];
        return mean_square.size() > 1 ? std::sqrt(sum / static_cast<double>(mean_square.size() - 1)) : 0;
    }
    double rms_seam() const { return std::sqrt(mean_square.back()); }
    double rms(bool with_seam) const {
        const double inside = rms_inside(), n = static_cast<double>(mean_square.size());
        return with_seam ? std::sqrt((inside * inside * (n - 1) + mean_square.back()) / n) : inside;
    }
};

Steps steps_x(const HeightField& s) {
    Steps steps{std::vector<double>(s.nx, 0.0)};
    for (int j = 0; j < s.ny; ++j) {
        const float* row = &s.heights[static_cast<size_t>(j) * s.nx];
        for (int i = 0; i < s.nx; ++i) {
            const double step = static_cast<double>(row[i + 1 < s.nx ? i + 1 : 0]) - row[i];
            steps.mean_square[i] += step * step / s.ny;
        }
    }
    return steps;
}

Steps steps_y(const HeightField& s) {
    Steps steps{std::vector<double>(s.ny, 0.0)};
    for (int j = 0; j < s.ny; ++j) {
        const float* row = &s.heights[static_cast<size_t>(j) * s.nx];
        const float* next = &s.heights[static_cast<size_t>((j + 1) % s.ny) * s.nx];
        double sum = 0;
        for (int i = 0; i < s.nx; ++i) {
            const double step = static_cast<double>(next[i]) - row[i];
            sum += step * step;
        }
        steps.mean_square[j] = sum / s.nx;
    }
    return steps;
}

double jump(const Steps& steps) {
    const double inside = steps.rms_inside(), seam = steps.rms_seam();
    return inside > 0 ? seam / inside
                      : 1;  // steps along a closed line sum to 0: no step inside means none across
}

// facet_gradient wraps every index, which costs ten times the arithmetic on large grids; here only the last
// column and row wrap.
double steepest_facet(const HeightField& s, bool open) {
    double steepest = 0;
    for (int j = 0; j < s.ny - (open && s.ny > 1 ? 1 : 0); ++j) {
        const float* row = &s.heights[static_cast<size_t>(j) * s.nx];
        const float* next = &s.heights[static_cast<size_t>((j + 1) % s.ny) * s.nx];
        for (int i = 0; i < s.nx - (open && s.nx > 1 ? 1 : 0); ++i) {
            const int e = i + 1 < s.nx ? i + 1 : 0;
            const double h00 = row[i], h10 = row[e], h01 = next[i], h11 = next[e];
            const Gradient lower{(h10 - h00) / s.pitch_x, (h11 - h10) / s.pitch_y};
            const Gradient upper{(h11 - h01) / s.pitch_x, (h01 - h00) / s.pitch_y};
            steepest = std::max(
                {steepest, lower.x * lower.x + lower.y * lower.y, upper.x * upper.x + upper.y * upper.y});
        }
    }
    return std::sqrt(steepest);
}

// Lag where the autocorrelation along lines of n heights (stride apart) falls to 1/e, linear between lags, in
// steps; 0 if it does not within half the period. At most 128 lines, evenly spread: enough for a figure that
// a person reads.
double correlation_lag(const HeightField& s, int n, size_t stride, int n_lines, size_t line_stride) {
    const int used = std::min(n_lines, 128);
    std::vector<float> lines(static_cast<size_t>(used) * n);
    for (int a = 0; a < used; ++a) {
        const size_t start = static_cast<size_t>(static_cast<long long>(a) * n_lines / used) * line_stride;
        for (int k = 0; k < n; ++k) lines[static_cast<size_t>(a) * n + k] = s.heights[start + k * stride];
    }
    auto correlation = [&](int lag) {
        double sum = 0;
        for (int a = 0; a < used; ++a) {
            const float* line = &lines[static_cast<size_t>(a) * n];
            for (int k = 0; k < n - lag; ++k) sum += static_cast<double>(line[k]) * line[k + lag];
            for (int k = n - lag; k < n; ++k) sum += static_cast<double>(line[k]) * line[k + lag - n];
        }
        return sum;
    };
    const double variance = correlation(0), target = variance / std::exp(1.0);
    double previous = variance;
    for (int lag = 1; lag <= n / 2; ++lag) {
        const double value = correlation(lag);
        if (value <= target) return variance > 0 ? lag - 1 + (previous - target) / (previous - value) : 0;
        previous = value;
    }
    return 0;
}

// A hash set of the bits, open addressing: a linear pass over 16 million heights, which std::unordered_set
// would make a minute of.
int count_distinct(const std::vector<float>& heights, int limit) {
    constexpr uint32_t slots = 1 << 18;
    std::vector<uint32_t> table(slots, 0);
    int count = 0;
    bool zero_seen = false;
    for (const float h : heights) {
        const uint32_t bits = std::bit_cast<uint32_t>(h == 0 ? 0.0f : h);  // -0 is 0
        if (bits == 0) {
            count += !zero_seen;
            zero_seen = true;
        } else {
            uint32_t slot = (bits * 2654435769u) >> 14;
            while (table[slot] != 0 && table[slot] != bits) slot = (slot + 1) % slots;
            if (table[slot] == 0) {
                table[slot] = bits;
                ++count;
            }
        }
        if (count >= limit) return limit;
    }
    return count;
}

bool is_open(const HeightField& s) {
    return s.border_x > 0 || s.border_y > 0;
}

// A seam is bad when it is steeper than the inside, and no place inside is as steep: a groove whose wall
// happens to be the seam is not.
bool bad_seam(const Steps& steps) {
    const size_t n = steps.mean_square.size();
    if (n < 3 || jump(steps) < 1.5) return false;
    return steps.mean_square.back() >
           *std::max_element(steps.mean_square.begin(), steps.mean_square.end() - 1);
}

}  // namespace

SurfaceStatistics surface_statistics(const HeightField& s) {
    SurfaceStatistics statistics;
    statistics.nx = s.nx, statistics.ny = s.ny;
    statistics.pitch_x = s.pitch_x, statistics.pitch_y = s.pitch_y;
    statistics.width = s.width(), statistics.depth = s.depth();
    double sum = 0;
    float lowest = s.heights[0], highest = s.heights[0];
    for (const float h : s.heights) {
        sum += static_cast<double>(h) * h;
        lowest = std::min(lowest, h), highest = std::max(highest, h);
    }
    statistics.sq = std::sqrt(sum / static_cast<double>(s.heights.size()));
    statistics.height_min = s.mean_height + lowest, statistics.height_max = s.mean_height + highest;

    const Steps x = steps_x(s), y = steps_y(s);
    statistics.rms_slope_x = x.rms(!is_open(s)) / s.pitch_x;
    statistics.rms_slope_y = y.rms(!is_open(s)) / s.pitch_y;
    statistics.max_slope = steepest_facet(s, is_open(s));
    statistics.wrap_jump_x = jump(x), statistics.wrap_jump_y = jump(y);
    statistics.correlation_length_x = s.pitch_x * correlation_lag(s, s.nx, 1, s.ny, s.nx);
    statistics.correlation_length_y = s.pitch_y * correlation_lag(s, s.ny, s.nx, s.nx, 1);
    statistics.distinct_heights = count_distinct(s.heights, 70000);
    statistics.invariant_x = x.rms(true) == 0, statistics.invariant_y = y.rms(true) == 0;
    return statistics;
}

std::vector<std::string> surface_warnings(const HeightField& surface, const SurfaceStatistics& statistics) {
    std::vector<std::string> warnings;
    // Generated reliefs of few heights (a groove has two) are not terraces: those come with many points on
    // each of some levels.
    const double points = static_cast<double>(surface.heights.size());
    if (statistics.distinct_heights > 16 && statistics.distinct_heights <= 256 &&
        points >= 16.0 * statistics.distinct_heights)
        warnings.push_back("only " + std::to_string(statistics.distinct_heights) +
                           " distinct heights, as from an 8-bit file: terraces make flat facets and steep "
                           "edges that the real surface "
                           "does not have; use 16-bit or floating-point heights");
    if (!is_open(surface)) {
        for (const auto& [axis, steps, ratio] : {std::tuple("x", steps_x(surface), statistics.wrap_jump_x),
                                                 std::tuple("y", steps_y(surface), statistics.wrap_jump_y)})
            if (bad_seam(steps))
                warnings.push_back(std::string("bad seam in ") + axis + ": the step across the edge is " +
                                   number_text(ratio, 3) +
                                   " times that inside; if the surface is not periodic, use the boundary "
                                   "mirror or open, or level it");
    }
    constexpr double longest_visible = 780e-9;
    if (const double pitch = std::min(surface.pitch_x, surface.pitch_y); pitch < 2 * longest_visible)
        warnings.push_back("the pitch of " + number_text(pitch * 1e9, 4) +
                           " nm is near or below the wavelength of visible light (380 to 780 nm): geometric "
                           "optics ignores diffraction, "
                           "which matters for relief this fine");
    return warnings;
}

}  // namespace gonio
