#include "server/service/hillshade.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/error.h"

namespace gonio {
namespace {

struct Slope {
    double x, y;
};

// Central differences over `step` points; wraps around as the surface does.
Slope slope_at(const HeightField& s, int i, int j, int step) {
    return {(s.at(i + step, j) - s.at(i - step, j)) / (2 * step * s.pitch_x),
            (s.at(i, j + step) - s.at(i, j - step)) / (2 * step * s.pitch_y)};
}

std::string png(const std::vector<uint8_t>& grey, int width, int height) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = PNG_FORMAT_GRAY;
    png_alloc_size_t bytes = 0;
    if (!png_image_write_to_memory(&image, nullptr, &bytes, 0, grey.data(), 0, nullptr))
        throw Error(ErrorCode::internal, "", "", std::string("PNG: ") + image.message);
    std::string out(bytes, '\0');
    if (!png_image_write_to_memory(&image, out.data(), &bytes, 0, grey.data(), 0, nullptr))
        throw Error(ErrorCode::internal, "", "", std::string("PNG: ") + image.message);
    out.resize(bytes);
    return out;
}

}  // namespace

std::string hillshade_png(const HeightField& surface, int most_pixels) {
    const int step = std::max(1, (std::max(surface.nx, surface.ny) + most_pixels - 1) / most_pixels);
    const int width = std::max(1, surface.nx / step), height = std::max(1, surface.ny / step);
    std::vector<Slope> slopes;
    slopes.reserve(static_cast<size_t>(width) * height);
    double squares = 0;
    for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column) {
            slopes.push_back(slope_at(surface, column * step, (height - 1 - row) * step, step));
            squares += slopes.back().x * slopes.back().x + slopes.back().y * slopes.back().y;
        }
    const double rms = std::sqrt(squares / static_cast<double>(slopes.size()));
    const double scale = rms > 0 ? 1 / rms : 1;
    constexpr double light_x = -0.5, light_y = 0.5, light_z = M_SQRT1_2;
    std::vector<uint8_t> grey(slopes.size());
    for (size_t k = 0; k < grey.size(); ++k) {
        const double x = scale * slopes[k].x, y = scale * slopes[k].y;
        const double cos_theta = (light_z - x * light_x - y * light_y) / std::sqrt(1 + x * x + y * y);
        grey[k] = static_cast<uint8_t>(std::lround(255 * std::clamp(cos_theta, 0.0, 1.0)));
    }
    return png(grey, width, height);
}

}  // namespace gonio
