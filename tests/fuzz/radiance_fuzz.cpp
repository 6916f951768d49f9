// Feeds bytes to the readers of radiance images. Whatever the bytes, only Error may come out, and what is
// read is finite and not negative.
#include <cmath>
#include <cstdint>
#include <string_view>

#include "base/error.h"
#include "surface/io/radiance_image.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace gonio;
    try {
        const RadianceImage image = decode_radiance_image(
            {"sky", {reinterpret_cast<const char*>(data), size}}, {.max_points = 1 << 16});
        if (image.values.size() != static_cast<size_t>(image.n_channels) * image.nx * image.ny)
            __builtin_trap();
        for (const float value : image.values)
            if (!(std::isfinite(value) && value >= 0)) __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}
