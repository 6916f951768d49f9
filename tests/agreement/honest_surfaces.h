// The reliefs and the table by which the stated errors are judged where no closed form is known.
#pragma once
#include <array>
#include <stdexcept>
#include <string>

#include "directions/gonio_grid.h"
#include "measure/brdf.h"
#include "surface/generate.h"

namespace gonio::honest {

struct GaussianSurface {
    const char* name;
    int samples;                // nodes along x and along y, pitch 1
    double correlation_length;  // cells
    double rms_slope;
    uint64_t seed;
    HeightField make() const {
        return generate_gaussian(samples, samples, 1, correlation_length, rms_slope, seed);
    }
};

inline constexpr std::array<GaussianSurface, 4> gaussian_surfaces{{{"gentle", 64, 8, 0.3, 11},
                                                                   {"rough", 64, 8, 0.7, 12},
                                                                   {"very_rough", 64, 8, 1.5, 13},
                                                                   {"fine_grained", 64, 2, 0.7, 14}}};

inline const GaussianSurface& gaussian_surface(const std::string& name) {
    for (const GaussianSurface& surface : gaussian_surfaces)
        if (name == surface.name) return surface;
    throw std::runtime_error("no surface " + name);
}

inline constexpr double albedo = 0.8;

inline Material material() {
    Lambertian lambertian;
    lambertian.albedo = {albedo};
    return {{"y"}, lambertian};
}

// 16 lights over the hemisphere, 16 views to 80 degrees: no two directions alike, so no two values are.
inline BrdfPlan plan() {
    BrdfPlan plan;
    plan.incident = equal_projected_hemisphere(16);
    plan.outgoing = product_grid({15, 40, 65, 80}, {20, 110, 200, 290});
    return plan;
}

}  // namespace gonio::honest
