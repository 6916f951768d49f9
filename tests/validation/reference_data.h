// The reference answers of tests/validation/data as gonio's nouns: a relief, a plan with the pairs, and the
// values expected.
#pragma once
#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "measure/plan.h"
#include "surface/generate.h"
#include "validation/load_json.h"

namespace gonio::reference {

// One column of answers: `order` 1 or 2 alone at albedo 1, or 0 for all orders at `albedo`.
struct Quantity {
    std::string key;
    int order = 0;
    double albedo = 1;
    std::vector<double> values, uncertainties;  // one a pair, in 1/sr
};

struct Case {
    std::string name, family;
    nlohmann::json document;
    std::vector<AnglesDeg> incident, outgoing;  // unique
    std::vector<std::pair<int, int>> pairs;
    std::vector<Quantity> quantities;

    // The plan of all pairs; quantities of order k need max_order >= k and separate_orders.
    BrdfPlan plan(int separate_orders = 0) const {
        BrdfPlan plan;
        plan.incident = incident;
        plan.outgoing = outgoing;
        plan.pairs = pairs;
        plan.max_order = separate_orders;
        plan.separate_orders = separate_orders > 0;
        return plan;
    }
    // One channel for each albedo of the quantities of all orders (order == 0), in their order; albedo 1 for
    // single orders.
    Material material(bool single_orders) const {
        std::vector<double> albedos;
        Material material;
        for (const Quantity& quantity : quantities)
            if (!single_orders && quantity.order == 0) {
                albedos.push_back(quantity.albedo);
                material.channels.push_back(quantity.key);
            }
        if (single_orders) {
            albedos = {1};
            material.channels = {"y"};
        }
        material.lobes = {{1.0, Lambertian{albedos}}};
        return material;
    }
};

// "micro" of an entry; nothing for separable masking, which is not offered.
inline std::optional<Lobe> lobe_of(const nlohmann::json& micro) {
    const std::string type = micro.at("type");
    const auto number = [&](const char* key, const char* other) {
        return micro.value(key, micro.value(other, 1.0));
    };
    if (type == "lambertian") return Lambertian{micro.at("rho").get<double>()};
    if (type == "phong_lafortune") return Phong{micro.at("exponent").get<double>(), number("ks", "F_or_ks")};
    if (micro.value("G", "").find("separable") != std::string::npos) return std::nullopt;
    const double alpha = micro.at("alpha");
    return Microfacet{type == "ggx" ? Microfacet::Distribution::ggx : Microfacet::Distribution::beckmann,
                      alpha,
                      alpha,
                      0.0,
                      {number("F", "F_or_ks"), {}, {}}};
}

inline AnglesDeg angles_of(const nlohmann::json& pair) {
    return {pair.at(0).get<double>(), pair.at(1).get<double>()};
}

// Cases of the families vgroove (Lambertian), rectgroove, spherical_pits, sinusoid and eggcrate.
inline Case load_case(const std::string& name) {
    Case result;
    result.name = name;
    result.document = load_json(name);
    result.family = result.document.at("family");
    const auto& entries = result.document.at("entries");
    for (const auto& [key, unused] : entries.at(0).at("values").items()) {
        Quantity quantity;
        quantity.key = key;
        quantity.order = key.starts_with("direct") ? 1 : key.starts_with("second_order") ? 2 : 0;
        quantity.albedo = std::stod(key.substr(key.find("rho") + 3));
        result.quantities.push_back(quantity);
    }
    const auto index_of = [](std::vector<AnglesDeg>& list, const nlohmann::json& angles) {
        const AnglesDeg direction{angles.at(0), angles.at(1)};
        const auto found = std::find(list.begin(), list.end(), direction);
        if (found == list.end()) {
            list.push_back(direction);
            return static_cast<int>(list.size()) - 1;
        }
        return static_cast<int>(found - list.begin());
    };
    for (const auto& entry : entries) {
        const int i = index_of(result.incident, entry.at("wi")),
                  o = index_of(result.outgoing, entry.at("wo"));
        result.pairs.emplace_back(i, o);
        const auto& uncertainty = entry.at("uncertainty");
        for (Quantity& quantity : result.quantities) {
            quantity.values.push_back(entry.at("values").at(quantity.key));
            quantity.uncertainties.push_back(uncertainty.is_object() ? uncertainty.at(quantity.key)
                                                                     : uncertainty);
        }
    }
    return result;
}

// The relief of a case with `samples` nodes a period along x (and along y, where it varies along y). Lengths
// of the file are taken for metres.
inline HeightField surface(const Case& reference, int samples) {
    const auto& s = reference.document.at("surface");
    if (reference.family == "vgroove") return generate_v_groove(samples, s.at("period_x"), s.at("alpha_deg"));
    if (reference.family == "rectgroove")
        return generate_rectangular_groove(samples, s.at("period_x"), s.at("groove_width_a"),
                                           s.at("depth_d"));
    if (reference.family == "spherical_pits")
        return generate_spherical_pits(samples, s.at("cell_side_L"), s.at("R"), s.at("eta_deg"));
    if (reference.family == "sinusoid") return generate_sinusoid(samples, s.at("period_x"), s.at("A"));
    if (reference.family == "eggcrate") return generate_egg_crate(samples, s.at("period_x"), s.at("A"));
    throw std::runtime_error("no closed-form height for the family " + reference.family);
}

}  // namespace gonio::reference
