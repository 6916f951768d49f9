// Light from all around: radiance as a function of direction, looked up wherever a scattering direction
// misses the surface (Heidrich et al. 2000, fig. 10). The relief is an infinite plane, so only directions
// above the horizon count.
#pragma once
#include <vector>

#include "directions/direction.h"
#include "surface/io/radiance_image.h"

namespace gonio {

// An equirectangular map of the whole sphere: row 0 begins at theta = 0, the last one ends at pi. As in
// OpenEXR's environment maps (their up is z here), the image's centre is phi = rotation and phi grows towards
// the left: column i holds phi = rotation + pi (1 - 2 (i + 1/2) / nx).
struct Environment {
    int nx = 0, ny = 0;
    int n_channels = 0;           // 1, or 3: red, green, blue
    std::vector<float> radiance;  // [(channel * ny + row) * nx + column]
    double rotation = 0;          // radians from x towards y

    // Radiance from `direction` (unit), bilinear between the centres of the texels. Integrals take a texel's
    // radiance as constant over the texel: they differ by O(texel^2).
    double at(int channel, const Vec3& direction) const;
    float texel(int channel, int row, int column) const {
        return radiance[(static_cast<size_t>(channel) * ny + row) * nx + column];
    }
};

enum class EnvironmentLayout {
    automatic,        // by the image's shape: 2 : 1, or 1 : 6
    equirectangular,  // any shape: it spans the sphere
    cube,  // six square faces below each other, +x -x +y -y +z -z, as OpenEXR's cube maps (z and y swapped
           // like above); resampled to an equirectangular map of 4 x 2 faces
};

// scale multiplies the radiances, > 0. Throws Error("/environment/...") for an image that does not fit the
// layout.
Environment make_environment(const RadianceImage& image, EnvironmentLayout layout, double rotation,
                             double scale);
// The same radiance from everywhere, one value a channel.
Environment uniform_environment(const std::vector<double>& radiance);

// The channels that a material of `n_channels` needs: one of RGB is its luminance, 0.2126 R + 0.7152 G +
// 0.0722 B (BT.709); several of one are all alike. Throws Error for RGB light on other than 1 or 3 channels.
Environment for_channels(const Environment& environment, int n_channels);

// Irradiance of a horizontal plane.
double horizontal_irradiance(const Environment& environment, int channel);
// Every channel over that: dark ones stay dark.
Environment with_unit_irradiance(const Environment& environment);

// Directions that all facets share (dependent tests), for facets that look at the environment one direction
// at a time: half of them as dense as it is bright, half alike over the upper hemisphere.
struct EnvironmentSamples {
    std::vector<Vec3> directions;
    std::vector<std::vector<float>> light;  // [channel]: radiance times the solid angle of the direction
};
// A lattice of n directions, stratified over the rows; shifts in [0, 1) randomise it.
EnvironmentSamples sample_environment(const Environment& environment, int n, double shift_row,
                                      double shift_column);

}  // namespace gonio
