#include "surface/prepare.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "surface/prepare_steps.h"

namespace gonio {
namespace {

constexpr long long max_points = 1LL << 28;  // of the prepared grid
constexpr int max_side = 1 << 16;            // that can be asked for by resample

void check_size(const char* field, long long nx, long long ny) {
    if (nx < 1 || ny < 1 || nx > max_points || ny > max_points || nx * ny > max_points)
        throw Error(ErrorCode::limit, field, std::to_string(nx) + " x " + std::to_string(ny) + " points",
                    "must lie between 1 x 1 and " + std::to_string(max_points) + " points in all");
}

// Positions are those of the stored file: column and row before any crop or flip.
void check_values(const Grid& grid, const PrepareOptions& options) {
    const int x0 = options.crop ? (*options.crop)[0] : 0, y0 = options.crop ? (*options.crop)[1] : 0;
    for (size_t k = 0; k < grid.heights.size(); ++k) {
        const double h = grid.heights[k];
        if (std::isfinite(h) || (std::isnan(h) && options.missing == Missing::interpolate)) continue;
        const std::string field = "/surface, stored column " +
                                  std::to_string(x0 + static_cast<int>(k % grid.nx)) + ", row " +
                                  std::to_string(y0 + static_cast<int>(k / grid.nx));
        throw Error(ErrorCode::invalid_input, field, number_text(h),
                    std::isnan(h) ? "is a missing point: set \"missing\": \"interpolate\", or crop it away"
                                  : "heights must be finite");
    }
}

// Cells along one side from which a ray of 75 degrees could climb from the lowest to above the highest point;
// beyond a quarter of the side there would be little left to measure.
int border(double height_range, double pitch, int n) {
    return static_cast<int>(std::min<double>(std::ceil(height_range / pitch * std::tan(radians(75))), n / 4));
}

void open_boundary(HeightField& surface, std::vector<std::string>& notes) {
    const auto [lowest, highest] = std::minmax_element(surface.heights.begin(), surface.heights.end());
    const double range = static_cast<double>(*highest) - *lowest;
    surface.border_x = border(range, surface.pitch_x, surface.nx);
    surface.border_y = border(range, surface.pitch_y, surface.ny);
    const double measured =
        (1 - 2.0 * surface.border_x / surface.nx) * (1 - 2.0 * surface.border_y / surface.ny);
    notes.push_back("open boundary: a border of " + std::to_string(surface.border_x) + " x " +
                    std::to_string(surface.border_y) + " cells on each side is not measured: " +
                    number_text(100 * (1 - measured), 3) + " % of the area");
}

}  // namespace

PreparedSurface prepare_surface(RawHeights raw, const PrepareOptions& options) {
    check_size("/surface", raw.nx, raw.ny);
    if (raw.values.size() != static_cast<size_t>(raw.nx) * raw.ny)
        throw Error(ErrorCode::invalid_input, "/surface", std::to_string(raw.values.size()) + " heights",
                    std::to_string(raw.nx) + " x " + std::to_string(raw.ny) + " points need one each");
    if (!std::isfinite(options.height_offset))
        throw Error(ErrorCode::invalid_input, "/surface/height_offset", number_text(options.height_offset),
                    "must be finite");

    PreparedSurface prepared;
    prepared.stored_bits = raw.bits;
    prepared.notes = std::move(raw.notes);
    // Width and height range speak of the whole stored grid, so they are resolved before anything is cut off.
    Scale scale = resolve_units(raw, options, prepared.notes);
    if (raw.bits == 8)
        prepared.notes.push_back("the file stores 8 bits: heights come in steps of " +
                                 number_text(scale.height, 3) + " m");

    Grid grid{raw.nx, raw.ny, std::move(raw.values)};
    if (options.crop) grid = cropped(grid, *options.crop);
    check_values(grid, options);
    if (const size_t filled = fill_missing(grid))
        prepared.notes.push_back(
            std::to_string(filled) + " missing points interpolated (" +
            number_text(100 * static_cast<double>(filled) / static_cast<double>(grid.heights.size()), 3) +
            " %)");
    if (!options.y_up.value_or(!raw.row0_at_top)) flip_rows(grid);

    const double sign = options.invert ? -1 : 1;
    for (double& h : grid.heights) h = sign * h * scale.height + options.height_offset;
    if (const std::string note = level_heights(grid, options.level, scale.pitch_x, scale.pitch_y);
        !note.empty())
        prepared.notes.push_back(note);
    if (options.resample) {
        const auto [nx, ny] = *options.resample;
        if (nx < 1 || ny < 1 || nx > max_side || ny > max_side)
            throw Error(ErrorCode::invalid_input, "/surface/resample",
                        std::to_string(nx) + " x " + std::to_string(ny),
                        "each must lie between 1 and " + std::to_string(max_side) + " points");
        // In between, one axis already has its new size and the other still its old one.
        check_size("/surface/resample", std::max(nx, grid.nx), std::max(ny, grid.ny));
        scale.pitch_x *= static_cast<double>(grid.nx) / nx;
        scale.pitch_y *= static_cast<double>(grid.ny) / ny;
        grid = resampled(grid, nx, ny, options.boundary == Boundary::periodic);
    }
    if (options.boundary == Boundary::mirror) {
        check_size("/surface/boundary", 2LL * grid.nx, 2LL * grid.ny);
        grid = mirrored(grid);
        prepared.notes.push_back("mirrored to " + std::to_string(grid.nx) + " x " + std::to_string(grid.ny) +
                                 " points: the period doubles and the BRDF becomes symmetric in x and in y");
    }
    try {
        prepared.surface = make_height_field(grid.nx, grid.ny, scale.pitch_x, scale.pitch_y, grid.heights);
    } catch (const Error& error) {
        throw Error(error.code(), "/surface/" + error.field(), error.value(), error.allowed());
    }
    if (options.boundary == Boundary::open) open_boundary(prepared.surface, prepared.notes);
    return prepared;
}

}  // namespace gonio
