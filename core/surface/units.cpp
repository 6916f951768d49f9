#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "surface/prepare_steps.h"

namespace gonio {
namespace {

// One axis of the pitch: what the user states, as pitch or as whole extent over n points.
std::optional<double> stated_pitch(const std::optional<double>& pitch, const char* pitch_name,
                                   const std::optional<double>& extent, const char* extent_name, int n) {
    for (const auto& [value, name] : {std::pair(pitch, pitch_name), std::pair(extent, extent_name)})
        if (value && !(std::isfinite(*value) && *value > 0))
            throw Error(ErrorCode::invalid_input, name, number_text(*value) + " m",
                        "must be a finite length above 0");
    if (pitch && extent)
        throw Error(ErrorCode::invalid_input, pitch_name, number_text(*pitch) + " m",
                    std::string("cannot stand beside ") + extent_name + ": state one of the two");
    return pitch ? pitch : extent ? std::optional(*extent / n) : std::nullopt;
}

// One stated axis gives the other by the file's aspect ratio, or square pixels where the file names none.
double aspect(const RawHeights& raw) {
    return raw.pitch_x && raw.pitch_y ? *raw.pitch_y / *raw.pitch_x : 1.0;
}

double required_pitch(const RawHeights& raw, const std::optional<double>& stated,
                      const std::optional<double>& from_other_axis, const std::optional<double>& carried,
                      const char* field, const char* alternative) {
    if (stated) return *stated;
    if (from_other_axis) return *from_other_axis;
    if (carried) return *carried;
    throw Error(ErrorCode::missing_unit, field, "",
                "the file (" + raw.format + ") does not carry this length: state it, or " + alternative);
}

void note_deviation(const char* what, double used, const std::optional<double>& carried, const char* unit,
                    std::vector<std::string>& notes) {
    if (carried && std::abs(used / *carried - 1) > 1e-6)
        notes.push_back(std::string(what) + " " + number_text(used, 6) + unit +
                        " used as stated; the file says " + number_text(*carried, 6) + unit);
}

double value_range(const RawHeights& raw) {
    double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
    for (const double v : raw.values)
        if (std::isfinite(v)) lowest = std::min(lowest, v), highest = std::max(highest, v);
    return highest > lowest ? highest - lowest : 0;
}

double height_scale(const RawHeights& raw, const PrepareOptions& options) {
    for (const auto& [value, name] : {std::pair(options.height_scale, "/surface/height_scale"),
                                      std::pair(options.height_range, "/surface/height_range")})
        if (value && !(std::isfinite(*value) && *value > 0))
            throw Error(ErrorCode::invalid_input, name, number_text(*value) + " m",
                        "must be a finite length above 0 (a depth map is \"invert\": true)");
    if (options.height_scale && options.height_range)
        throw Error(ErrorCode::invalid_input, "/surface/height_range",
                    number_text(*options.height_range) + " m",
                    "cannot stand beside /surface/height_scale: state one of the two");
    if (options.height_scale) return *options.height_scale;
    if (options.height_range) {
        const double stored = raw.integer_max > 0 ? raw.integer_max : value_range(raw);
        return stored > 0 ? *options.height_range / stored
                          : 1;  // all heights equal: any scale gives the same plane
    }
    if (raw.height_unit) return *raw.height_unit;
    throw Error(
        ErrorCode::missing_unit, "/surface/height_scale", "",
        "the file (" + raw.format +
            ") does not carry a unit of height: state height_scale (length per stored unit) or height_range");
}

}  // namespace

Scale resolve_units(const RawHeights& raw, const PrepareOptions& options, std::vector<std::string>& notes) {
    const auto stated_x =
        stated_pitch(options.pitch_x, "/surface/pitch_x", options.width, "/surface/width", raw.nx);
    const auto stated_y =
        stated_pitch(options.pitch_y, "/surface/pitch_y", options.depth, "/surface/depth", raw.ny);
    const auto x_from_y = stated_y ? std::optional(*stated_y / aspect(raw)) : std::nullopt;
    const auto y_from_x = stated_x ? std::optional(*stated_x * aspect(raw)) : std::nullopt;
    Scale scale;
    scale.pitch_x =
        required_pitch(raw, stated_x, x_from_y, raw.pitch_x, "/surface/width", "/surface/pitch_x");
    scale.pitch_y =
        required_pitch(raw, stated_y, y_from_x, raw.pitch_y, "/surface/depth", "/surface/pitch_y");
    scale.height = height_scale(raw, options);
    note_deviation("pitch in x of", scale.pitch_x, raw.pitch_x, " m", notes);
    note_deviation("pitch in y of", scale.pitch_y, raw.pitch_y, " m", notes);
    note_deviation("height unit of", scale.height, raw.height_unit, " m", notes);
    return scale;
}

}  // namespace gonio
