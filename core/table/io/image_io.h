// Pictures of the base plane: named channels of floats as OpenEXR, and 8-bit PNG for looking.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace gonio {

// Row 0 of every channel is at low y; files begin with the top row, so that +y points up in a viewer.
struct Picture {
    int width = 0, height = 0;
    struct Channel {
        std::string name;  // "total.Y": a dot ends the name of a layer
        std::vector<float> pixels;
    };
    std::vector<Channel> channels;
    std::vector<std::pair<std::string, std::string>>
        attributes;  // provenance: attributes gonio.KEY, and all in `comments`
};

// OpenEXR names of colour channels: r g b y become R G B Y; a dot, as in "450.5nm", a comma.
std::string exr_channel_name(const std::string& channel);

// float32, ZIP. Throws Error(io).
void write_exr_picture(const Picture& picture, const std::string& path);

// One channel, or three as red, green and blue: clamp(value * scale, 0, 1) by the sRGB curve; without the
// curve for masks and fractions (`linear`). The provenance stands in text chunks. Throws Error(io).
struct PngChannels {
    int width = 0, height = 0;
    std::vector<const float*> channels;
    double scale = 1;
    bool linear = false;
    std::vector<std::pair<std::string, std::string>> attributes;
};
void write_png_picture(const PngChannels& picture, const std::string& path);

}  // namespace gonio
