// Colours that people with any colour vision can tell apart.
#pragma once
#include <string>
#include <vector>

#include "clients/plot/canvas.h"

namespace gonio {

inline constexpr Colour ink{0.13, 0.13, 0.16}, grey{0.45, 0.45, 0.48}, pale{0.86, 0.86, 0.88};

// Categories: Okabe and Ito 2008, "Color universal design", without yellow and black (weak on white; the
// text's own).
Colour category_colour(size_t k);

// viridis (van der Walt and Smith 2015), t in [0, 1]: even in lightness, so that it also prints in grey.
Colour viridis(double t);

// Channels: "r", "g", "b" in their hue, "450nm" by place along the list.
Colour channel_colour(const std::vector<std::string>& channels, size_t k);

uint32_t argb(Colour colour);

}  // namespace gonio
