#include "surface/generate.h"

#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/text.h"

namespace gonio {
namespace {

void check_samples(int samples) {
    if (samples < 1 || samples > 1 << 16)
        throw Error(ErrorCode::invalid_input, "samples", std::to_string(samples),
                    "must lie between 1 and 65536");
}

// Lengths that are not the pitch itself (make_height_field guards that one).
void check_length(const char* field, double length, bool allowed_zero = false) {
    if (!(std::isfinite(length) && (length > 0 || (allowed_zero && length == 0))))
        throw Error(ErrorCode::invalid_input, field, number_text(length) + " m",
                    allowed_zero ? "must be a finite length, 0 or more" : "must be a finite length above 0");
}

// height(x) on nodes x = (i + offset) period / samples, one row: the surface is invariant along y.
HeightField profile(int samples, double period, double offset, const std::function<double(double)>& height) {
    const double pitch = period / samples;
    std::vector<double> heights;
    heights.reserve(samples);
    for (int i = 0; i < samples; ++i) heights.push_back(height((i + offset) * pitch));
    return make_height_field(samples, 1, pitch, pitch, heights);
}

HeightField square_cell(int samples, double period, double offset,
                        const std::function<double(double, double)>& height) {
    const double pitch = period / samples;
    std::vector<double> heights;
    heights.reserve(static_cast<size_t>(samples) * samples);
    for (int j = 0; j < samples; ++j)
        for (int i = 0; i < samples; ++i)
            heights.push_back(height((i + offset) * pitch, (j + offset) * pitch));
    return make_height_field(samples, samples, pitch, pitch, heights);
}

}  // namespace

HeightField generate_plane(int samples, double pitch) {
    check_samples(samples);
    return make_height_field(samples, samples, pitch, pitch,
                             std::vector<double>(static_cast<size_t>(samples) * samples, 0.0));
}

HeightField generate_v_groove(int samples, double period, double slope_deg) {
    check_samples(samples);
    if (samples % 2 != 0)
        throw Error(ErrorCode::invalid_input, "samples", std::to_string(samples),
                    "must be even, so that ridge and valley both lie on samples");
    check_length("period", period);
    if (!(slope_deg >= 0 && slope_deg < 90))
        throw Error(ErrorCode::invalid_input, "slope_deg", number_text(slope_deg), "must lie in [0, 90)");
    const double slope = std::tan(radians(slope_deg));
    return profile(samples, period, 0, [=](double x) { return slope * std::min(x, period - x); });
}

HeightField generate_rectangular_groove(int samples, double period, double groove_width, double depth) {
    check_samples(samples);
    check_length("period", period);
    check_length("depth", depth, true);
    check_length("groove_width", groove_width);
    if (!(groove_width < period))
        throw Error(ErrorCode::invalid_input, "groove_width", number_text(groove_width) + " m",
                    "must be less than the period");
    return profile(samples, period, 0.5, [=](double x) { return x < groove_width ? -depth : 0.0; });
}

HeightField generate_sinusoid(int samples, double period, double amplitude) {
    check_samples(samples);
    check_length("period", period);
    check_length("amplitude", amplitude, true);
    return profile(samples, period, 0, [=](double x) { return amplitude * std::sin(2 * pi * x / period); });
}

HeightField generate_egg_crate(int samples, double period, double amplitude) {
    check_samples(samples);
    check_length("period", period);
    check_length("amplitude", amplitude, true);
    return square_cell(samples, period, 0, [=](double x, double y) {
        return amplitude * (std::cos(2 * pi * x / period) + std::cos(2 * pi * y / period));
    });
}

// Cell-centred, as tests/validation samples its pits: no node lies on a pit's axis or on the border between
// two cells.
HeightField generate_spherical_pits(int samples, double period, double radius, double eta_deg) {
    check_samples(samples);
    check_length("period", period);
    check_length("radius", radius);
    if (!(eta_deg > 0 && eta_deg <= 90))
        throw Error(ErrorCode::invalid_input, "eta_deg", number_text(eta_deg), "must lie in (0, 90]");
    const double eta = radians(eta_deg), rim = radius * std::sin(eta);
    if (2 * rim > period)
        throw Error(ErrorCode::invalid_input, "radius", number_text(radius) + " m",
                    "the pit of this radius and eta_deg must fit into the period");
    return square_cell(samples, period, 0.5, [=](double x, double y) {
        const double u = x - period / 2, v = y - period / 2, r2 = u * u + v * v;
        return r2 < rim * rim ? radius * std::cos(eta) - safe_sqrt(radius * radius - r2) : 0.0;
    });
}

}  // namespace gonio
