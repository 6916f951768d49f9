// The material of one facet in double precision, clarity over speed: what the path tracer and the tests use,
// and what the faster kernels are held against.
#pragma once
#include <optional>
#include <span>

#include "directions/direction.h"
#include "material/local_frame.h"
#include "material/material.h"
#include "surface/height_field.h"

namespace gonio {

class FacetBrdf {
  public:
    // Facet `kind` of cell (i, j). The material must outlive it and be valid for the surface. The frame: the
    // normal n of the flat facet; the tangent is what stands above (1, 0) on the facet, which a rotation
    // turns towards what stands above (0, 1); the bitangent is n x t.
    FacetBrdf(const Material& material, const HeightField& surface, int kind, int i, int j);

    const Vec3& normal() const { return frame_.normal; }

    // f_micro(wi, wo) in 1/sr for each channel; world directions, 0 unless both are above the facet. What has
    // no density (mirrors) is left out.
    void eval(const Vec3& wi, const Vec3& wo, std::span<double> f) const;
    // Of sample(), per solid angle; what has no density left out.
    double pdf(const Vec3& wo, const Vec3& wi) const;

    struct Sample {
        Vec3 wi;
        double pdf;  // of the lobes with a density; of a mirror: its probability
        bool is_delta;
    };
    // weight[c] = f cos_i / pdf of the whole material; nothing if the light is absorbed or the sample falls
    // below the facet. Random numbers in [0, 1).
    std::optional<Sample> sample(const Vec3& wo, double u_lobe, double u1, double u2,
                                 std::span<double> weight) const;

    bool has_delta() const;
    bool has_density() const;

  private:
    LocalFrame frame_of(const Lobe& lobe) const;
    double odds(size_t k, double cos_o) const;
    double sum_of_odds(double cos_o) const;

    const Material& material_;
    Gradient gradient_;
    LocalFrame frame_;  // without rotation
    int i_, j_;
};

}  // namespace gonio
