#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "material/metals.h"
#include "server/job_sections.h"
#include "server/parse_parameter.h"

namespace gonio {
namespace {

constexpr size_t most_lobes = 16;

class MaterialParser {
  public:
    explicit MaterialParser(const std::string& folder) : numbers_(folder) {}

    MaterialSource parse(const JsonNode& node) {
        if (const auto wavelengths = node.find("wavelengths_nm")) numbers_.claim_wavelengths(*wavelengths);
        parse_part(node, 1.0, {"wavelengths_nm"});
        Material& material = source_.material;
        material.channels = numbers_.channels();
        if (material.channels.empty()) {
            if (metals_.empty())
                material.channels = {"y"};
            else
                material.channels = {"r", "g", "b"};
        }
        for (const MetalLobe& metal : metals_) set_index(metal);
        validate(material, 1, 1);  // the weights add up
        return std::move(source_);
    }

  private:
    // "metal": the index of it in each channel, when those are known.
    struct MetalLobe {
        size_t lobe;
        Metal metal;
        JsonNode node;
    };

    // A lobe, or a mixture of them; `more_keys` may stand beside its own.
    void parse_part(const JsonNode& node, const Parameter& weight, std::vector<std::string> more_keys) {
        std::vector<std::string> models = {"lambertian", "phong",          "blinn_phong", "ggx",
                                           "beckmann",   "coated_diffuse", "mirror",      "mixture"};
        const std::string model = node.at("model").choice(models);
        more_keys.push_back("model");
        if (model == "mixture") {
            more_keys.push_back("parts");
            node.allow_keys(more_keys);
            parse_mixture(node.at("parts"), weight);
            return;
        }
        if (source_.material.lobes.size() == most_lobes)
            node.refuse("a material has at most " + std::to_string(most_lobes) + " parts");
        source_.material.lobes.push_back({weight, Lambertian{}});
        Lobe& lobe = source_.material.lobes.back().lobe;
        if (model == "lambertian") {
            allow(node, more_keys, {"albedo"});
            lobe = Lambertian{number(node, "albedo", share_range)};
        } else if (model == "phong" || model == "blinn_phong") {
            allow(node, more_keys, {"exponent", "albedo"});
            const Parameter exponent = number(node, "exponent", exponent_range),
                            albedo = number(node, "albedo", share_range);
            if (model == "phong")
                lobe = Phong{exponent, albedo};
            else
                lobe = BlinnPhong{exponent, albedo};
        } else if (model == "coated_diffuse") {
            allow(node, more_keys, {"eta", "alpha", "albedo"});
            const Parameter eta = number(node, "eta", coat_eta_range),
                            alpha = number(node, "alpha", alpha_range);
            lobe = CoatedDiffuse{eta, alpha, number(node, "albedo", share_range)};
        } else if (model == "mirror") {
            allow(node, more_keys, {"reflectance", "metal", "eta", "k"});
            lobe = Mirror{specular(node)};
        } else {
            lobe = parse_microfacet(node, model, more_keys);
        }
    }

    void parse_mixture(const JsonNode& parts, const Parameter& outer) {
        for (size_t k = 0; k < parts.array_size(); ++k) {
            const JsonNode part = parts.element(k), weight_node = part.at("weight");
            if (outer.range().first < 1 && is_mapped(weight_node))
                weight_node.refuse("a mixture inside a mixture has constant weights");
            const size_t first = source_.material.lobes.size();
            Parameter weight = numbers_.parse(weight_node, share_range);
            if (is_mapped(weight_node)) add_map("weight", first, weight_node);
            parse_part(part, product(weight, outer), {"weight"});
            if (is_mapped(weight_node) && source_.material.lobes.size() != first + 1)
                weight_node.refuse("only a single lobe can have a map as its weight, not a mixture");
        }
    }

    static bool is_mapped(const JsonNode& node) { return node.has("file") || node.has("files"); }

    static Parameter product(const Parameter& a, const Parameter& b) {
        std::vector<double> values(std::max(a.n_channels(), b.n_channels()));
        for (size_t c = 0; c < values.size(); ++c) values[c] = a.at(c, 0, 0) * b.at(c, 0, 0);
        return values;
    }

    Lobe parse_microfacet(const JsonNode& node, const std::string& model,
                          const std::vector<std::string>& more_keys) {
        allow(node, more_keys,
              {"alpha", "alpha_x", "alpha_y", "rotation_deg", "reflectance", "metal", "eta", "k"});
        Microfacet lobe;
        lobe.distribution =
            model == "ggx" ? Microfacet::Distribution::ggx : Microfacet::Distribution::beckmann;
        if (const auto alpha = node.find("alpha")) {
            for (const char* other : {"alpha_x", "alpha_y"})
                if (const auto both = node.find(other))
                    both->refuse(R"(stands instead of "alpha", not beside it)");
            lobe.alpha_x = lobe.alpha_y = number(node, "alpha", alpha_range, {"alpha_x", "alpha_y"});
        } else if (node.has("alpha_x") || node.has("alpha_y")) {
            lobe.alpha_x = number(node, "alpha_x", alpha_range);
            lobe.alpha_y = number(node, "alpha_y", alpha_range);
        } else {
            node.at("alpha");  // says that it is missing
        }
        if (node.has("rotation_deg")) lobe.rotation_deg = number(node, "rotation_deg", rotation_range);
        lobe.reflectance = specular(node);
        return lobe;
    }

    // "reflectance", "metal", or "eta" and "k".
    SpecularReflectance specular(const JsonNode& node) {
        const bool stated[] = {node.has("reflectance"), node.has("metal"), node.has("eta") || node.has("k")};
        if (std::count(std::begin(stated), std::end(stated), true) != 1)
            node.refuse(R"(needs one of "reflectance", "metal", and "eta" with "k")");
        if (stated[0]) return {number(node, "reflectance", share_range), {}, {}};
        if (stated[2]) {
            const Parameter eta = number(node, "eta", metal_eta_range);
            return {{}, eta, number(node, "k", metal_k_range)};
        }
        const JsonNode name = node.at("metal");
        const std::string metal = name.choice({metal_names.begin(), metal_names.end()});
        const auto found = std::find(metal_names.begin(), metal_names.end(), metal);
        metals_.push_back(
            {source_.material.lobes.size() - 1, static_cast<Metal>(found - metal_names.begin()), name});
        return {{}, 1.0, 0.0};
    }

    void set_index(const MetalLobe& metal) {
        std::vector<double> eta, k;
        const std::vector<double>& wavelengths_nm = numbers_.wavelengths_nm();
        for (size_t c = 0; c < source_.material.channels.size(); ++c) {
            if (!wavelengths_nm.empty() &&
                !(wavelengths_nm[c] >= shortest_metal_nm && wavelengths_nm[c] <= longest_metal_nm))
                metal.node.refuse("is known from " + number_text(shortest_metal_nm) + " to " +
                                  number_text(longest_metal_nm) + " nm, not at " +
                                  number_text(wavelengths_nm[c]) + " nm");
            const ComplexIndex index = wavelengths_nm.empty() ? metal_index_rgb(metal.metal)[c]
                                                              : metal_index(metal.metal, wavelengths_nm[c]);
            eta.push_back(index.eta);
            k.push_back(index.k);
        }
        const SpecularReflectance specular{{}, eta, k};
        Lobe& lobe = source_.material.lobes[metal.lobe].lobe;
        if (auto* microfacet = std::get_if<Microfacet>(&lobe))
            microfacet->reflectance = specular;
        else
            lobe = Mirror{specular};
    }

    static void allow(const JsonNode& node, std::vector<std::string> keys,
                      const std::vector<std::string>& own) {
        keys.insert(keys.end(), own.begin(), own.end());
        node.allow_keys(keys);
    }

    // A number of the lobe that is parsed; `names`: the parameters that it sets, if not the one of its own
    // name.
    Parameter number(const JsonNode& node, const std::string& key, const ParameterRange& range,
                     const std::vector<std::string>& names = {}) {
        const JsonNode value = node.at(key);
        Parameter parameter = numbers_.parse(value, range);
        if (is_mapped(value))
            for (const std::string& name : names.empty() ? std::vector<std::string>{key} : names)
                add_map(name, source_.material.lobes.size() - 1, value);
        return parameter;
    }

    void add_map(const std::string& parameter, size_t lobe, const JsonNode& value) {
        source_.maps.push_back({lobe, parameter, value.path(), numbers_.files().back().paths});
    }

    ParameterParser numbers_;
    MaterialSource source_;
    std::vector<MetalLobe> metals_;
};

}  // namespace

MaterialSource parse_material(const JsonNode& node, const std::string& folder) {
    return MaterialParser(folder).parse(node);
}

}  // namespace gonio
