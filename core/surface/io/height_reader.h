// Reading measured height fields: one file a format, one line a format in height_reader.cpp. Readers
// distrust: every extent and product is checked against the file's size and the limits before anything is
// allocated.
#pragma once
#include <optional>
#include <string>
#include <vector>

namespace gonio {

// What a file says, in its own numbers: nothing is guessed here.
struct RawHeights {
    int nx = 0, ny = 0;
    std::vector<double> values;  // nx * ny, stored order: stored row 0 first; NaN marks a missing point
    bool row0_at_top = false;  // images and GSF: stored row 0 is at the top, so y = 0 is the last stored row
    std::optional<double> pitch_x, pitch_y;  // metres, if the file carries them
    std::optional<double> height_unit;       // metres per stored unit, if the file carries it
    int bits = 0;                            // of an integer format: 8 or 16; 0 for floating point
    double integer_max =
        0;  // 255 or 65535 for integer formats: what height_range refers to; 0 for floating point
    std::string format;              // "gsf", "png", ...
    std::vector<std::string> notes;  // for the user: "PNG carries 2835 pixels per metre, ignored", ...
};

struct ReadLimits {
    long long max_points = 1LL << 28;  // nx * ny
    long long max_bytes = 4LL << 30;   // of the file
};

// Detects the format by content where it has a signature, else by extension; without either, text is a text
// matrix. Throws Error (not_found, io, invalid_input, limit).
RawHeights read_heights(const std::string& path, const ReadLimits& limits = {});

}  // namespace gonio
