#include "clients/plot/palette.h"

#include <algorithm>
#include <cmath>

namespace gonio {

Colour category_colour(size_t k) {
    static constexpr Colour colours[] = {{0.000, 0.447, 0.698}, {0.835, 0.369, 0.000}, {0.000, 0.620, 0.451},
                                         {0.800, 0.475, 0.655}, {0.902, 0.624, 0.000}, {0.337, 0.706, 0.914}};
    return colours[k % std::size(colours)];
}

Colour viridis(double t) {
    // Nine samples of the published table; straight lines between them stay within 0.01 of it.
    static constexpr Colour table[] = {{0.267, 0.005, 0.329}, {0.279, 0.175, 0.483}, {0.230, 0.322, 0.546},
                                       {0.173, 0.449, 0.558}, {0.128, 0.567, 0.551}, {0.158, 0.684, 0.502},
                                       {0.369, 0.789, 0.383}, {0.678, 0.864, 0.190}, {0.993, 0.906, 0.144}};
    const double position = std::clamp(t, 0.0, 1.0) * 8;
    const int k = std::min(static_cast<int>(position), 7);
    const double w = position - k;
    const Colour &a = table[k], &b = table[k + 1];
    return {a.r + w * (b.r - a.r), a.g + w * (b.g - a.g), a.b + w * (b.b - a.b)};
}

Colour channel_colour(const std::vector<std::string>& channels, size_t k) {
    if (channels[k] == "r") return {0.80, 0.20, 0.15};
    if (channels[k] == "g") return {0.10, 0.55, 0.30};
    if (channels[k] == "b") return {0.15, 0.35, 0.75};
    if (channels.size() == 1) return category_colour(0);
    return viridis(0.85 * static_cast<double>(k) / static_cast<double>(channels.size() - 1));
}

uint32_t argb(Colour colour) {
    auto byte = [](double x) { return static_cast<uint32_t>(std::lround(255 * std::clamp(x, 0.0, 1.0))); };
    return 0xff000000u | byte(colour.r) << 16 | byte(colour.g) << 8 | byte(colour.b);
}

}  // namespace gonio
