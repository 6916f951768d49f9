#include "material/material.h"

#include "base/error.h"
#include "base/text.h"

namespace gonio {
namespace {

constexpr const char* allowed_albedo = "an albedo must lie in [0, 1]";

void validate(const Lambertian& lambertian, size_t n_channels, int nx, int ny) {
    const size_t cells = static_cast<size_t>(nx) * ny;
    if (!lambertian.is_map()) {
        if (lambertian.albedo.size() != n_channels)
            throw Error(ErrorCode::invalid_input, "/material/albedo",
                        std::to_string(lambertian.albedo.size()) + " values",
                        "needs one value a channel, that is " + std::to_string(n_channels));
        for (size_t c = 0; c < n_channels; ++c)
            if (const double a = lambertian.albedo[c]; !(a >= 0 && a <= 1))
                throw Error(ErrorCode::invalid_input,
                            "/material/albedo" + (n_channels > 1 ? "/" + std::to_string(c) : std::string()),
                            number_text(a), allowed_albedo);
        return;
    }
    if (lambertian.map_nx != nx || lambertian.map_ny != ny || lambertian.map.size() != n_channels * cells)
        throw Error(ErrorCode::invalid_input, "/material/map",
                    std::to_string(lambertian.map_nx) + " x " + std::to_string(lambertian.map_ny),
                    "must have a value for every channel of each of the surface's " + std::to_string(nx) +
                        " x " + std::to_string(ny) + " cells");
    for (size_t k = 0; k < lambertian.map.size(); ++k)
        if (const float a = lambertian.map[k]; !(a >= 0 && a <= 1))
            throw Error(
                ErrorCode::invalid_input,
                "/material/map, column " + std::to_string(k % nx) + ", row " + std::to_string(k % cells / nx),
                number_text(a), allowed_albedo);
}

}  // namespace

void validate(const Material& material, int nx, int ny) {
    if (material.channels.empty())
        throw Error(ErrorCode::invalid_input, "/material", "", "needs at least one channel");
    std::visit([&](const auto& reflectance) { validate(reflectance, material.channels.size(), nx, ny); },
               material.reflectance);
}

}  // namespace gonio
