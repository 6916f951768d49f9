#include "scattering/environment.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace gonio {
namespace {

// Value of a plane of nx x ny texels at (x, y), in texels from its corner: bilinear, wrapped or clamped at
// the sides, clamped at top and bottom.
double bilinear(const float* plane, int nx, int ny, double x, double y, bool wraps) {
    const double column = x - 0.5, row = std::clamp(y - 0.5, 0.0, ny - 1.0);
    const auto i = static_cast<long long>(std::floor(column));
    const int j = std::min(static_cast<int>(row), ny - 1), j1 = std::min(j + 1, ny - 1);
    const auto place = [&](long long k) {
        return wraps ? wrap_index(k, nx) : static_cast<int>(std::clamp<long long>(k, 0, nx - 1));
    };
    const int i0 = place(i), i1 = place(i + 1);
    const double u = column - static_cast<double>(i), v = row - j;
    const auto at = [&](int r, int c) { return static_cast<double>(plane[static_cast<size_t>(r) * nx + c]); };
    return (1 - v) * ((1 - u) * at(j, i0) + u * at(j, i1)) + v * ((1 - u) * at(j1, i0) + u * at(j1, i1));
}

// Face and place on it, in [-1, 1], of a direction in OpenEXR's frame (y up): ImfEnvmap, CubeMap.
struct CubePlace {
    int face;
    double x, y;
};
CubePlace cube_place(const Vec3& d) {
    const double ax = std::abs(d.x), ay = std::abs(d.y), az = std::abs(d.z);
    if (ax >= ay && ax >= az) return {d.x > 0 ? 0 : 1, (d.x > 0 ? d.z : -d.z) / ax, d.y / ax};
    if (ay >= az) return {d.y > 0 ? 2 : 3, d.x / ay, (d.y > 0 ? d.z : -d.z) / ay};
    return {d.z > 0 ? 4 : 5, (d.z > 0 ? -d.x : d.x) / az, d.y / az};
}

Environment from_cube(const RadianceImage& image) {
    const int size = image.nx;
    Environment e;
    e.nx = 4 * size, e.ny = 2 * size, e.n_channels = image.n_channels;
    e.radiance.resize(static_cast<size_t>(e.n_channels) * e.nx * e.ny);
    for (int j = 0; j < e.ny; ++j)
        for (int i = 0; i < e.nx; ++i) {
            const double theta = pi * (j + 0.5) / e.ny, phi = pi * (1 - 2 * (i + 0.5) / e.nx);
            // OpenEXR's z is our x, its x our y, its y our z.
            const CubePlace place = cube_place(
                {std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi)});
            for (int c = 0; c < e.n_channels; ++c)
                e.radiance[(static_cast<size_t>(c) * e.ny + j) * e.nx + i] = static_cast<float>(
                    bilinear(&image.values[(static_cast<size_t>(c) * 6 + place.face) * size * size], size,
                             size, 0.5 * (place.x + 1) * size, 0.5 * (1 - place.y) * size, false));
        }
    return e;
}

}  // namespace

double Environment::at(int channel, const Vec3& d) const {
    const double phi = std::atan2(d.y, d.x) - rotation, theta = safe_acos(d.z);
    return bilinear(&radiance[static_cast<size_t>(channel) * nx * ny], nx, ny, (0.5 - phi / (2 * pi)) * nx,
                    theta / pi * ny, true);
}

Environment make_environment(const RadianceImage& image, EnvironmentLayout layout, double rotation,
                             double scale) {
    const bool is_cube = image.ny == 6LL * image.nx, is_sphere = image.nx == 2LL * image.ny;
    const std::string shape = std::to_string(image.nx) + " x " + std::to_string(image.ny);
    if (layout == EnvironmentLayout::cube && !is_cube)
        throw Error(ErrorCode::invalid_input, "/environment/file", shape,
                    "a cube map must be six times as high as wide");
    if (layout == EnvironmentLayout::automatic && !is_cube && !is_sphere)
        throw Error(ErrorCode::invalid_input, "/environment/file", shape,
                    "an equirectangular map is twice as wide as high, a cube map six times as high as wide; "
                    "say which one it is with \"layout\"");
    Environment e;
    if (layout == EnvironmentLayout::cube || (layout == EnvironmentLayout::automatic && is_cube)) {
        e = from_cube(image);
    } else {
        e.nx = image.nx, e.ny = image.ny, e.n_channels = image.n_channels;
        e.radiance = image.values;
    }
    for (float& value : e.radiance) {
        value = static_cast<float>(value * scale);
        if (!std::isfinite(value))
            throw Error(ErrorCode::invalid_input, "/environment/scale", "",
                        "the scaled radiances must stay within the range of floats");
    }
    e.rotation = rotation;
    return e;
}

Environment uniform_environment(const std::vector<double>& radiance) {
    Environment e;
    e.nx = 8, e.ny = 4, e.n_channels = static_cast<int>(radiance.size());
    for (const double value : radiance) e.radiance.insert(e.radiance.end(), 32, static_cast<float>(value));
    return e;
}

Environment for_channels(const Environment& environment, int n_channels) {
    if (environment.n_channels == n_channels) return environment;
    Environment e = environment;
    e.n_channels = n_channels;
    const size_t plane = static_cast<size_t>(e.nx) * e.ny;
    e.radiance.resize(n_channels * plane);
    if (environment.n_channels == 1) {
        for (int c = 1; c < n_channels; ++c)
            std::copy_n(environment.radiance.begin(), plane,
                        e.radiance.begin() + static_cast<long>(c * plane));
    } else if (n_channels == 1) {
        const float* rgb = environment.radiance.data();
        for (size_t k = 0; k < plane; ++k)
            e.radiance[k] =
                static_cast<float>(0.2126 * rgb[k] + 0.7152 * rgb[plane + k] + 0.0722 * rgb[2 * plane + k]);
    } else {
        throw Error(ErrorCode::invalid_input, "/environment", "RGB",
                    "lights materials of one channel (by its luminance) or of r, g, b; a material of " +
                        std::to_string(n_channels) + " channels needs a grey one");
    }
    return e;
}

double horizontal_irradiance(const Environment& e, int channel) {
    double sum = 0;
    for (int j = 0; j < e.ny; ++j) {
        // Exactly the share of a row that is above the horizon, weighed by the cosine.
        const double high = std::max(0.0, std::cos(pi * j / e.ny)),
                     low = std::max(0.0, std::cos(pi * (j + 1) / e.ny));
        double row = 0;
        for (int i = 0; i < e.nx; ++i) row += e.texel(channel, j, i);
        sum += row * 2 * pi / e.nx * 0.5 * (high * high - low * low);
    }
    return sum;
}

Environment with_unit_irradiance(const Environment& environment) {
    Environment e = environment;
    const size_t plane = static_cast<size_t>(e.nx) * e.ny;
    for (int c = 0; c < e.n_channels; ++c)
        if (const double irradiance = horizontal_irradiance(environment, c); irradiance > 0)
            for (size_t k = 0; k < plane; ++k)
                e.radiance[c * plane + k] = static_cast<float>(e.radiance[c * plane + k] / irradiance);
    return e;
}

EnvironmentSamples sample_environment(const Environment& e, int n, double shift_row, double shift_column) {
    const auto height = [&](int row) { return std::max(0.0, std::cos(pi * row / e.ny)); };
    const int n_rows = (e.ny + 1) / 2;
    // Per steradian, 1 on average over the hemisphere: each channel counts alike.
    std::vector<double> density(static_cast<size_t>(n_rows) * e.nx, 0.0);
    int bright = 0;
    for (int c = 0; c < e.n_channels; ++c) {
        double mean = 0;
        for (int j = 0; j < n_rows; ++j)
            for (int i = 0; i < e.nx; ++i) mean += e.texel(c, j, i) * (height(j) - height(j + 1)) / e.nx;
        if (!(mean > 0)) continue;
        ++bright;
        for (size_t k = 0; k < density.size(); ++k)
            density[k] += e.radiance[static_cast<size_t>(c) * e.nx * e.ny + k] / mean;
    }
    for (double& d : density) d = bright > 0 ? 0.5 + 0.5 * d / bright : 1.0;
    // Shares of the rows, and inside each of its columns.
    std::vector<double> row_ends, column_ends(density.size());
    double total = 0;
    for (int j = 0; j < n_rows; ++j) {
        double row = 0;
        for (int i = 0; i < e.nx; ++i) {
            row += density[static_cast<size_t>(j) * e.nx + i];
            column_ends[static_cast<size_t>(j) * e.nx + i] = row;
        }
        total += row * (height(j) - height(j + 1));
        row_ends.push_back(total);
    }
    EnvironmentSamples samples;
    samples.light.resize(e.n_channels);
    const double golden = (std::sqrt(5.0) - 1) / 2;
    for (int k = 0; k < n; ++k) {
        const double at = total * (k + shift_row) / n;
        const int j = static_cast<int>(std::min<long>(
            std::upper_bound(row_ends.begin(), row_ends.end(), at) - row_ends.begin(), n_rows - 1));
        const double before = j > 0 ? row_ends[j - 1] : 0.0,
                     down = std::clamp((at - before) / (row_ends[j] - before), 0.0, 1.0);
        const auto columns = column_ends.begin() + static_cast<long>(j) * e.nx;
        const double turn = k * golden + shift_column, across = (turn - std::floor(turn)) * columns[e.nx - 1];
        const int i = static_cast<int>(
            std::min<long>(std::upper_bound(columns, columns + e.nx, across) - columns, e.nx - 1));
        const double d = density[static_cast<size_t>(j) * e.nx + i],
                     left = std::clamp(1 - (columns[i] - across) / d, 0.0, 1.0);
        const double z = std::max(1e-4,
                                  height(j) + down * (height(j + 1) - height(j))),  // as slab_directions
            r = safe_sqrt(1 - z * z), phi = e.rotation + pi * (1 - 2 * (i + left) / e.nx);
        samples.directions.push_back({r * std::cos(phi), r * std::sin(phi), z});
        const double solid_angle = 2 * pi * total / e.nx / (n * d);
        for (int c = 0; c < e.n_channels; ++c)
            samples.light[c].push_back(static_cast<float>(solid_angle * e.texel(c, j, i)));
    }
    return samples;
}

}  // namespace gonio
