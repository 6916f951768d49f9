// From stored numbers to the relief that is simulated: units, orientation, levelling, cropping, resampling, boundary.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "surface/height_field.h"
#include "surface/io/height_reader.h"

namespace gonio {

enum class Boundary { periodic, mirror, open };
enum class Level { none, mean, plane, quadratic };
enum class Missing { reject, interpolate };

// Lengths in metres. An empty optional means "not stated": the file must carry it, or it is an error that names the field.
struct PrepareOptions {
    std::optional<double> width, depth;      // of the whole stored grid: pitch = width / nx
    std::optional<double> pitch_x, pitch_y;
    std::optional<double> height_scale;      // metres per stored unit
    std::optional<double> height_range;      // metres from stored 0 to the integer maximum (floats: from the lowest to the highest value)
    double height_offset = 0;                // metres, added last
    bool invert = false;                     // a depth map: large is deep
    std::optional<bool> y_up;                // stored row 0 at y = 0 (true) or at the top (false); default: the format's habit
    std::optional<std::array<int, 4>> crop;  // stored columns and rows: x, y, width, height
    std::optional<std::array<int, 2>> resample;  // to nx, ny nodes: box average down, bilinear up (periodic)
    Level level = Level::none;
    Boundary boundary = Boundary::periodic;
    Missing missing = Missing::reject;
};

struct PreparedSurface {
    HeightField surface;
    int stored_bits = 0;              // of the file, for the terrace warning
    std::vector<std::string> notes;   // what was done: "levelled by a plane (slopes 0.01, -0.02)", "border of 31 cells not measured: 44 % of the area", ...
};

// Only one width depth pair is needed when the pitch is square: a stated width alone gives pitch_y = pitch_x.
// Errors name the field under "/surface".
PreparedSurface prepare_surface(RawHeights raw, const PrepareOptions& options);

}  // namespace gonio
