#include "surface/height_field.h"

#include <cmath>

#include "base/error.h"
#include "base/sha256.h"
#include "base/text.h"

namespace gonio {
namespace {

constexpr double min_pitch = 1e-15,
                 max_pitch = 1e7;  // metres: below a proton, above the Earth's radius is a slip of units
// Steeper is a slip of units too, and its square must stay far from the end of float.
constexpr double max_slope = 1e9;

[[noreturn]] void refuse_height(size_t index, int nx, double value, const std::string& allowed) {
    throw Error(ErrorCode::invalid_input,
                "height at column " + std::to_string(index % nx) + ", row " + std::to_string(index / nx),
                number_text(value), allowed);
}

void check_pitch(const char* field, double pitch) {
    if (!(pitch >= min_pitch && pitch <= max_pitch))
        throw Error(ErrorCode::invalid_input, field, number_text(pitch) + " m",
                    "must be a length from 1e-15 m to 1e7 m");
}

void check_slopes(int nx, int ny, double pitch_x, double pitch_y, const std::vector<double>& heights) {
    for (int j = 0; j < ny; ++j) {
        const size_t row = static_cast<size_t>(j) * nx, next_row = static_cast<size_t>((j + 1) % ny) * nx;
        for (int i = 0; i < nx; ++i) {
            const double h = heights[row + i];
            const double step_x = std::abs(heights[row + (i + 1) % nx] - h),
                         step_y = std::abs(heights[next_row + i] - h);
            if (!(step_x <= max_slope * pitch_x && step_y <= max_slope * pitch_y))
                refuse_height(row + i, nx, h,
                              "a step to the next point of more than 1e9 pitches; check the units");
        }
    }
}

}  // namespace

HeightField make_height_field(int nx, int ny, double pitch_x, double pitch_y,
                              const std::vector<double>& heights) {
    if (nx < 1 || ny < 1 || heights.size() != static_cast<size_t>(nx) * static_cast<size_t>(ny))
        throw Error(ErrorCode::invalid_input, "grid", std::to_string(nx) + " x " + std::to_string(ny),
                    "needs at least 1 x 1 points and one height each, found " +
                        std::to_string(heights.size()) + " heights");
    check_pitch("pitch_x", pitch_x);
    check_pitch("pitch_y", pitch_y);
    for (size_t k = 0; k < heights.size(); ++k)
        if (!std::isfinite(heights[k])) refuse_height(k, nx, heights[k], "heights must be finite numbers");
    check_slopes(nx, ny, pitch_x, pitch_y, heights);

    HeightField surface;
    surface.nx = nx, surface.ny = ny;
    surface.pitch_x = pitch_x, surface.pitch_y = pitch_y;
    // About the first height: a sum of numbers near 1e6 pitches would lose the digits that a constant surface
    // must keep.
    double sum = 0;
    for (const double h : heights) sum += h - heights[0];
    surface.mean_height = heights[0] + sum / static_cast<double>(heights.size());
    surface.heights.reserve(heights.size());
    for (const double h : heights) surface.heights.push_back(static_cast<float>(h - surface.mean_height));
    return surface;
}

std::string surface_hash(const HeightField& s) {
    const int sizes[] = {s.nx, s.ny, s.border_x, s.border_y};
    const double pitches[] = {s.pitch_x, s.pitch_y};
    std::vector<double> base;  // a flat one leaves no trace
    if (s.base.is_curved()) base = {s.base.kappa_1, s.base.kappa_2, s.base.direction};
    if (s.base.corrects_horizons()) base.push_back(static_cast<double>(s.base.correction));
    return sha256_hex({bytes_of(sizes, 4), bytes_of(pitches, 2), bytes_of(s.heights.data(), s.heights.size()),
                       bytes_of(base.data(), base.size())});
}

}  // namespace gonio
