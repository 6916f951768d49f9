// Images of radiance: OpenEXR, and the .hdr of Radiance (RGBE).
#pragma once
#include <string>
#include <vector>

#include "surface/io/formats.h"

namespace gonio {

// Linear values in the file's own unit, finite and >= 0.
struct RadianceImage {
    int nx = 0, ny = 0;
    int n_channels = 0;         // 1, or 3: red, green, blue
    std::vector<float> values;  // [(channel * ny + row) * nx + column], row 0 at the top
};

RadianceImage read_exr_radiance(const FileBytes& file, const ReadLimits& limits);
RadianceImage read_radiance_hdr(const FileBytes& file, const ReadLimits& limits);

// Detects the format by content. Throws Error (not_found, io, invalid_input, limit), also for values below 0
// or not finite.
RadianceImage read_radiance_image(const std::string& path, const ReadLimits& limits = {});
// The same of a file in memory (what the fuzzer feeds).
RadianceImage decode_radiance_image(const FileBytes& file, const ReadLimits& limits);

}  // namespace gonio
