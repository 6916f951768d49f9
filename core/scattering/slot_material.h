// The material on the facets of a tile as the batch kernels want it: one channel, floats per slot.
#pragma once
#include <optional>
#include <vector>

#include "material/material.h"
#include "scattering/tile.h"
#include "surface/height_field.h"

namespace gonio {

// One lobe that is not Lambertian. f = weight * shape (* Fresnel): shape per lobe_shapes-inl.h, whatever
// scales it (normalisation, reflectance, weight in the mixture) inside `weight`.
struct SlotLobe {
    enum class Shape { ggx, beckmann, blinn_phong, phong, coat_base };
    Shape shape = Shape::ggx;
    bool anisotropic = false, fresnel = false;
    // Of all facets, if it is the same: Fresnel's factor then depends on the two directions alone.
    struct Index {
        float eta, k;
    };
    std::optional<Index> same_index;
    std::vector<float> weight;
    std::vector<float> alpha2,
        sharpness;  // alpha^2 and 1 / alpha^2 (isotropic); or the exponent in `sharpness`
    // Anisotropic: tangent / alpha_x, bitangent / alpha_y, alpha^4.
    std::vector<float> tangent_x, tangent_y, tangent_z, bitangent_x, bitangent_y, bitangent_z, alpha_x4,
        alpha_y4;
    std::vector<float> eta, k;                // of the Fresnel factor (k = 0: dielectric)
    std::vector<float> coat_eta, coat_alpha;  // of what passes a coat
};

struct SlotMaterial {
    std::vector<float> lambert;  // f of the Lambertian lobes, per slot
    std::vector<SlotLobe> lobes;
};

// The channel of the material; delta lobes (Mirror) are left out. 0 in the padding of the tile.
SlotMaterial slot_material(const Material& material, const HeightField& surface, const Tile& tile,
                           size_t channel);

// Channels that need one transport of light: channel c is `scale[c]` times the reflectance of `channels[0]`,
// so order k of scattering is scale^k times its.
struct ChannelGroup {
    std::vector<size_t> channels;
    std::vector<double> scale;
};
std::vector<ChannelGroup> channel_groups(const Material& material);

}  // namespace gonio
