#include "scattering/slot_material.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "material/coat.h"
#include "material/lobe_parameters.h"
#include "material/local_frame.h"
#include "surface/facet_mesh.h"

namespace gonio {
namespace {

// visit(slot, kind, i, j) for every facet of the tile.
template <class Visit>
void for_each_facet(const Tile& tile, Visit&& visit) {
    for (int kind = 0; kind < 2; ++kind)
        for (int row = 0; row < tile.area.height; ++row)
            for (int column = 0; column < tile.area.width; ++column)
                visit(tile.slot(kind, row, column), kind, wrap_index(tile.area.x0 + column, tile.nx),
                      wrap_index(tile.area.y0 + row, tile.ny));
}

// Puts the lobes of one channel of a material onto the slots of a tile.
struct Builder {
    const HeightField& surface;
    const Tile& tile;
    size_t channel;
    SlotMaterial result;

    using CellValue = std::function<double(int i, int j)>;

    std::vector<float> on_slots(const CellValue& value, float padding = 0) const {
        std::vector<float> values(tile.n_slots(), padding);
        for_each_facet(
            tile, [&](size_t slot, int, int i, int j) { values[slot] = static_cast<float>(value(i, j)); });
        return values;
    }
    // Of the displaced facet on a curved base.
    Gradient gradient_of(size_t slot, int kind, int i, int j) const {
        if (!surface.base.is_curved()) return facet_gradient(surface, kind, i, j);
        return {-tile.normal_x[slot] / tile.normal_z[slot], -tile.normal_y[slot] / tile.normal_z[slot]};
    }
    CellValue value_of(const Parameter& p) const {
        return [&p, this](int i, int j) { return p.at(channel, i, j); };
    }

    void add_lambert(const CellValue& f) {
        for_each_facet(tile, [&](size_t slot, int, int i, int j) {
            result.lambert[slot] += static_cast<float>(f(i, j));
        });
    }

    void add_microfacets(const Microfacet& m, const CellValue& weight) {
        SlotLobe lobe;
        lobe.shape = m.distribution == Microfacet::Distribution::ggx ? SlotLobe::Shape::ggx
                                                                     : SlotLobe::Shape::beckmann;
        lobe.fresnel = m.reflectance.fresnel();
        lobe.anisotropic = m.alpha_x.constant != m.alpha_y.constant || m.alpha_x.map != m.alpha_y.map;
        const auto alpha_x = value_of(m.alpha_x), alpha_y = value_of(m.alpha_y);
        // D G2 / (4 cos cos) = 1 / (2 pi alpha_x alpha_y) / (q^2 (z_o s_i + z_i s_o)), q = tan^2 / alpha^2
        // z^2 + z^2
        lobe.weight = on_slots([&](int i, int j) {
            const double own = lobe.fresnel ? 1.0 : m.reflectance.reflectance.at(channel, i, j);
            return weight(i, j) * own / (2 * pi * alpha_x(i, j) * alpha_y(i, j));
        });
        if (lobe.fresnel) {
            lobe.eta = on_slots(value_of(m.reflectance.eta));
            lobe.k = on_slots(value_of(m.reflectance.k));
            if (!m.reflectance.eta.is_map() && !m.reflectance.k.is_map())
                lobe.same_index = {static_cast<float>(m.reflectance.eta.at(channel, 0, 0)),
                                   static_cast<float>(m.reflectance.k.at(channel, 0, 0))};
        }
        if (!lobe.anisotropic) {
            lobe.alpha2 = on_slots([&](int i, int j) { return std::pow(alpha_x(i, j), 2); });
            lobe.sharpness = on_slots([&](int i, int j) { return std::pow(alpha_x(i, j), -2); }, 1);
        } else {
            lobe.alpha_x4 = on_slots([&](int i, int j) { return std::pow(alpha_x(i, j), 4); });
            lobe.alpha_y4 = on_slots([&](int i, int j) { return std::pow(alpha_y(i, j), 4); });
            for (auto* axis : {&lobe.tangent_x, &lobe.tangent_y, &lobe.tangent_z, &lobe.bitangent_x,
                               &lobe.bitangent_y, &lobe.bitangent_z})
                axis->assign(tile.n_slots(), 0.0f);
            for_each_facet(tile, [&](size_t slot, int kind, int i, int j) {
                const LocalFrame frame(gradient_of(slot, kind, i, j), m.rotation_deg.at(0, i, j));
                const double x = alpha_x(i, j), y = alpha_y(i, j);
                lobe.tangent_x[slot] = static_cast<float>(frame.tangent.x / x);
                lobe.tangent_y[slot] = static_cast<float>(frame.tangent.y / x);
                lobe.tangent_z[slot] = static_cast<float>(frame.tangent.z / x);
                lobe.bitangent_x[slot] = static_cast<float>(frame.bitangent.x / y);
                lobe.bitangent_y[slot] = static_cast<float>(frame.bitangent.y / y);
                lobe.bitangent_z[slot] = static_cast<float>(frame.bitangent.z / y);
            });
        }
        result.lobes.push_back(std::move(lobe));
    }

    void add(const Lambertian& l, const CellValue& weight) {
        add_lambert([&](int i, int j) { return weight(i, j) * l.albedo.at(channel, i, j) / pi; });
    }
    void add(const Phong& l, const CellValue& weight) {
        SlotLobe lobe;
        lobe.shape = SlotLobe::Shape::phong;
        lobe.sharpness = on_slots(value_of(l.exponent));
        lobe.weight = on_slots([&](int i, int j) {
            return weight(i, j) * l.albedo.at(channel, i, j) * (l.exponent.at(0, i, j) + 2) / (2 * pi);
        });
        result.lobes.push_back(std::move(lobe));
    }
    void add(const BlinnPhong& l, const CellValue& weight) {
        SlotLobe lobe;
        lobe.shape = SlotLobe::Shape::blinn_phong;
        lobe.sharpness = on_slots(value_of(l.exponent));
        lobe.weight = on_slots([&](int i, int j) {
            const double n = l.exponent.at(0, i, j);
            return weight(i, j) * l.albedo.at(channel, i, j) * (n + 2) * (n + 4) /
                   (8 * pi * (std::exp2(-n / 2) + n));
        });
        result.lobes.push_back(std::move(lobe));
    }
    void add(const Microfacet& l, const CellValue& weight) { add_microfacets(l, weight); }
    void add(const CoatedDiffuse& l, const CellValue& weight) {
        Microfacet coat;
        coat.alpha_x = coat.alpha_y = l.alpha;
        coat.reflectance.eta = l.eta;
        coat.reflectance.k = 0.0;
        add_microfacets(coat, weight);
        SlotLobe base;
        base.shape = SlotLobe::Shape::coat_base;
        base.coat_eta = on_slots(value_of(l.eta));
        base.coat_alpha = on_slots(value_of(l.alpha));
        base.weight = on_slots([&](int i, int j) {
            return weight(i, j) / pi *
                   coat_base_factor(l.eta.at(0, i, j), l.alpha.at(0, i, j), l.albedo.at(channel, i, j));
        });
        result.lobes.push_back(std::move(base));
    }
    void add(const Mirror&, const CellValue&) {}
};

// All that the lobes of one channel reflect, as numbers, if no map is among them: {} otherwise. Two channels
// with proportional numbers scatter alike.
struct Strengths {
    bool comparable = true;
    std::vector<double> linear, fixed;  // proportional to the reflectance; its shape (metals)
};

Strengths strengths(const Material& material, size_t channel) {
    Strengths s;
    for (const WeightedLobe& part : material.lobes) {
        const double weight = part.weight.is_map() ? 1.0 : part.weight.at(channel, 0, 0);
        s.comparable = s.comparable && (!part.weight.is_map() || part.weight.n_channels() == 1);
        double linear = weight;
        std::visit(
            [&](const auto& lobe) {
                using Kind = std::decay_t<decltype(lobe)>;
                visit_parameters(
                    lobe, [&](const char* name, const Parameter& p, const ParameterRange& range) {
                        if (!range.by_channel || p.n_channels() == 1) return;
                        if (p.is_map())
                            s.comparable = false;
                        else if (!std::is_same_v<Kind, CoatedDiffuse> &&
                                 (std::string(name) == "albedo" || std::string(name) == "reflectance"))
                            linear *= p.at(channel, 0, 0);
                        else
                            s.fixed.push_back(p.at(channel, 0, 0));
                    });
            },
            part.lobe);
        s.linear.push_back(linear);
    }
    return s;
}

// `a` over `b` if they are proportional, else a negative number.
double ratio(const Strengths& a, const Strengths& b) {
    if (!a.comparable || !b.comparable || a.fixed != b.fixed) return -1;
    const auto largest = std::max_element(b.linear.begin(), b.linear.end());
    if (!(*largest > 0)) return a.linear == b.linear ? 1 : -1;
    const double r = a.linear[static_cast<size_t>(largest - b.linear.begin())] / *largest;
    for (size_t k = 0; k < a.linear.size(); ++k)
        if (std::abs(a.linear[k] - r * b.linear[k]) > 1e-12 * *largest) return -1;
    return r;
}

}  // namespace

SlotMaterial slot_material(const Material& material, const HeightField& surface, const Tile& tile,
                           size_t channel) {
    Builder builder{surface, tile, channel, {}};
    builder.result.lambert.assign(tile.n_slots(), 0.0f);
    for (const WeightedLobe& part : material.lobes)
        std::visit([&](const auto& lobe) { builder.add(lobe, builder.value_of(part.weight)); }, part.lobe);
    return std::move(builder.result);
}

std::vector<ChannelGroup> channel_groups(const Material& material) {
    std::vector<ChannelGroup> groups;
    std::vector<Strengths> firsts;
    for (size_t c = 0; c < material.channels.size(); ++c) {
        const Strengths own = strengths(material, c);
        bool found = false;
        for (size_t g = 0; g < groups.size() && !found; ++g)
            if (const double r = ratio(own, firsts[g]); r >= 0) {
                groups[g].channels.push_back(c);
                groups[g].scale.push_back(r);
                found = true;
            }
        if (found) continue;
        groups.push_back({{c}, {1.0}});
        firsts.push_back(own);
    }
    return groups;
}

}  // namespace gonio
