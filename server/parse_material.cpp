#include "base/error.h"
#include "base/text.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

double checked_albedo(const JsonNode& node) {
    return node.number(0, 1);
}

std::vector<double> albedos(const JsonNode& node) {
    std::vector<double> values(node.array_size());
    for (size_t c = 0; c < values.size(); ++c) values[c] = checked_albedo(node.element(c));
    return values;
}

Material constant_albedo(std::vector<std::string> channels, std::vector<double> albedo) {
    Lambertian lambertian;
    lambertian.albedo = std::move(albedo);
    return {std::move(channels), std::move(lambertian)};
}

// {"wavelengths_nm": [...], "values": [...]}: one channel a wavelength, named "450nm".
Material parse_spectrum(const JsonNode& albedo) {
    albedo.allow_keys({"wavelengths_nm", "values"});
    const JsonNode wavelengths_node = albedo.at("wavelengths_nm"), values_node = albedo.at("values");
    const std::vector<double> wavelengths_nm = wavelengths_node.numbers();
    std::vector<double> values = albedos(values_node);
    if (values.size() != wavelengths_nm.size()) {
        values_node.refuse("must have one value for each of the " + std::to_string(wavelengths_nm.size()) +
                           " wavelengths");
    }
    std::vector<std::string> channels;
    for (size_t c = 0; c < wavelengths_nm.size(); ++c) {
        if (!(wavelengths_nm[c] > (c == 0 ? 0 : wavelengths_nm[c - 1]))) {
            wavelengths_node.element(c).refuse("wavelengths must be above 0 and increase");
        }
        channels.push_back(number_text(wavelengths_nm[c]) + "nm");
    }
    return constant_albedo(std::move(channels), std::move(values));
}

MaterialSource parse_albedo(const JsonNode& albedo, const std::string& folder) {
    if (albedo.raw().is_number()) return {constant_albedo({"y"}, {checked_albedo(albedo)}), ""};
    if (albedo.raw().is_array()) {
        if (albedo.raw().size() != 3) albedo.refuse("must be [r, g, b], three numbers from 0 to 1");
        return {constant_albedo({"r", "g", "b"}, albedos(albedo)), ""};
    }
    if (albedo.has("file")) {
        albedo.allow_keys({"file"});
        return {{{"y"}, Lambertian{}}, resolved(albedo.at("file").text(), folder)};
    }
    if (albedo.raw().is_object()) return {parse_spectrum(albedo), ""};
    albedo.refuse(
        R"(must be a number from 0 to 1, [r, g, b], {"wavelengths_nm": [...], "values": [...]} or {"file": "map.png"})");
}

}  // namespace

MaterialSource parse_material(const JsonNode& material, const std::string& folder) {
    material.allow_keys({"model", "albedo"});
    material.at("model").choice({"lambertian"});
    return parse_albedo(material.at("albedo"), folder);
}

}  // namespace gonio
