// Feeds bytes to the height readers and, when they are read, to the preparation. Whatever the bytes, only
// Error may come out. The first byte chooses the extension for formats without a signature, and the steps of
// the preparation.
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/error.h"
#include "surface/io/formats.h"
#include "surface/prepare.h"
#include "surface/statistics.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace gonio;
    if (size == 0) return 0;
    constexpr const char* names[] = {"a.txt", "a.gsf", "a.png", "a.exr", "a.npy", "a.pfm", "a.csv", "a"};
    const int choice = data[0];
    const FileBytes file{names[choice & 7], {reinterpret_cast<const char*>(data + 1), size - 1}};
    try {
        RawHeights raw = decode_heights(file, {.max_points = 1 << 16});
        if (raw.values.size() != static_cast<size_t>(raw.nx) * raw.ny) __builtin_trap();
        PrepareOptions options;
        options.width = 1, options.height_range = 0.1;
        options.missing = choice & 8 ? Missing::interpolate : Missing::reject;
        options.level = static_cast<Level>(choice >> 4 & 3);
        options.boundary = static_cast<Boundary>((choice >> 6) % 3);
        const HeightField surface = prepare_surface(std::move(raw), options).surface;
        const SurfaceStatistics statistics = surface_statistics(surface);
        if (!std::isfinite(statistics.sq) || !std::isfinite(statistics.rms_slope_x) ||
            statistics.max_slope < 0)
            __builtin_trap();
        surface_warnings(surface, statistics);
    } catch (const Error&) {
    }
    return 0;
}
