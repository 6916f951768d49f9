// A picture of a height field.
#pragma once
#include <string>

#include "surface/height_field.h"

namespace gonio {

// PNG, 8 bit grey, at most `most_pixels` wide and high, y up: Lambertian relief lit from the upper left at 45
// degrees, slopes scaled so that their rms is 1 (a micro-surface of rms slope 0.05 would be a grey square).
std::string hillshade_png(const HeightField& surface, int most_pixels = 512);

}  // namespace gonio
