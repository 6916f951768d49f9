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
    return {std::move(channels), Lambertian{std::move(albedo)}};
}

// The paths of maps, one a channel.
MaterialSource albedo_maps(std::vector<std::string> channels, const JsonNode& files,
                           const std::string& folder) {
    if (files.array_size() != channels.size())
        files.refuse("must have one file for each of the " + std::to_string(channels.size()) + " channels");
    MaterialSource source{{std::move(channels), Lambertian{}}, {}};
    for (size_t c = 0; c < files.array_size(); ++c)
        source.albedo_maps.push_back(resolved(files.element(c).text(), folder));
    return source;
}

// {"wavelengths_nm": [...], "values": [...]} or, with a map for each, "files": one channel a wavelength,
// named "450nm".
MaterialSource parse_spectrum(const JsonNode& albedo, const std::string& folder) {
    const bool maps = albedo.has("files");
    albedo.allow_keys({"wavelengths_nm", maps ? "files" : "values"});
    const JsonNode wavelengths_node = albedo.at("wavelengths_nm"),
                   values_node = albedo.at(maps ? "files" : "values");
    const std::vector<double> wavelengths_nm = wavelengths_node.numbers();
    std::vector<std::string> channels;
    for (size_t c = 0; c < wavelengths_nm.size(); ++c) {
        if (!(wavelengths_nm[c] > (c == 0 ? 0 : wavelengths_nm[c - 1])))
            wavelengths_node.element(c).refuse("wavelengths must be above 0 and increase");
        channels.push_back(number_text(wavelengths_nm[c]) + "nm");
    }
    if (maps) return albedo_maps(std::move(channels), values_node, folder);
    std::vector<double> values = albedos(values_node);
    if (values.size() != wavelengths_nm.size())
        values_node.refuse("must have one value for each of the " + std::to_string(wavelengths_nm.size()) +
                           " wavelengths");
    return {constant_albedo(std::move(channels), std::move(values)), {}};
}

MaterialSource parse_albedo(const JsonNode& albedo, const std::string& folder) {
    if (albedo.raw().is_number()) return {constant_albedo({"y"}, {checked_albedo(albedo)}), {}};
    if (albedo.raw().is_array()) {
        if (albedo.raw().size() != 3) albedo.refuse("must be [r, g, b], three numbers from 0 to 1");
        return {constant_albedo({"r", "g", "b"}, albedos(albedo)), {}};
    }
    if (albedo.has("file")) {
        albedo.allow_keys({"file"});
        return {{{"y"}, Lambertian{}}, {resolved(albedo.at("file").text(), folder)}};
    }
    if (albedo.has("files") && !albedo.has("wavelengths_nm")) {
        albedo.allow_keys({"files"});
        return albedo_maps({"r", "g", "b"}, albedo.at("files"), folder);
    }
    if (albedo.raw().is_object()) return parse_spectrum(albedo, folder);
    albedo.refuse(
        R"(must be a number from 0 to 1, [r, g, b], {"wavelengths_nm": [...], "values": [...]}, {"file": "map.png"} or {"files": ["r.png", "g.png", "b.png"]})");
}

}  // namespace

MaterialSource parse_material(const JsonNode& material, const std::string& folder) {
    material.allow_keys({"model", "albedo"});
    material.at("model").choice({"lambertian"});
    return parse_albedo(material.at("albedo"), folder);
}

}  // namespace gonio
