#include "surface/io/radiance_image.h"

#include <cmath>

#include "base/text.h"

namespace gonio {

RadianceImage decode_radiance_image(const FileBytes& file, const ReadLimits& limits) {
    const bool hdr = file.bytes.starts_with("#?");
    if (!hdr && !file.bytes.starts_with(std::string_view("\x76\x2f\x31\x01", 4)))
        refuse(file, "", "is neither OpenEXR nor Radiance .hdr, the two formats of an environment");
    RadianceImage image = hdr ? read_radiance_hdr(file, limits) : read_exr_radiance(file, limits);
    for (size_t k = 0; k < image.values.size(); ++k) {
        if (std::isfinite(image.values[k]) && image.values[k] >= 0) continue;
        const size_t pixel = k % (static_cast<size_t>(image.nx) * image.ny);
        refuse(file,
               number_text(image.values[k]) + " at column " + std::to_string(pixel % image.nx) + ", row " +
                   std::to_string(pixel / image.nx),
               "radiance must be a finite number of at least 0");
    }
    return image;
}

RadianceImage read_radiance_image(const std::string& path, const ReadLimits& limits) {
    return decode_radiance_image({path, read_bytes(path, limits)}, limits);
}

}  // namespace gonio
