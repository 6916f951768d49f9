#include "server/parse_parameter.h"

#include "base/text.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

std::vector<double> numbers(const JsonNode& node, const ParameterRange& range) {
    std::vector<double> values(node.array_size());
    for (size_t c = 0; c < values.size(); ++c) values[c] = node.element(c).number(range.low, range.high);
    return values;
}

std::string allowed(const ParameterRange& range) {
    const std::string from_to = " from " + number_text(range.low) + " to " + number_text(range.high);
    if (!range.by_channel) return "must be a number" + from_to + R"(, or {"file": "map.exr"})";
    return "must be a number" + from_to +
           R"(, [r, g, b], {"wavelengths_nm": [...], "values": [...]}, {"file": "map.png"} or {"files": ["r.png", "g.png", "b.png"]})";
}

}  // namespace

void ParameterParser::claim(std::vector<std::string> channels, std::vector<double> wavelengths_nm,
                            const JsonNode& node) {
    if (channels_.empty()) {
        channels_ = std::move(channels);
        wavelengths_nm_ = std::move(wavelengths_nm);
    } else if (channels != channels_) {
        std::string names;
        for (const std::string& name : channels_) names += (names.empty() ? "" : ", ") + name;
        node.refuse("must have the channels that stand before it in the material: " + names);
    }
}

void ParameterParser::claim_wavelengths(const JsonNode& node) {
    const std::vector<double> wavelengths_nm = node.numbers();
    std::vector<std::string> channels;
    for (size_t c = 0; c < wavelengths_nm.size(); ++c) {
        if (!(wavelengths_nm[c] > (c == 0 ? 0 : wavelengths_nm[c - 1])))
            node.element(c).refuse("wavelengths must be above 0 and increase");
        channels.push_back(number_text(wavelengths_nm[c]) + "nm");
    }
    claim(std::move(channels), wavelengths_nm, node);
}

Parameter ParameterParser::add_files(const JsonNode& node, const JsonNode& files,
                                     const ParameterRange& range) {
    if (files.array_size() != channels_.size())
        files.refuse("must have one file for each of the " + std::to_string(channels_.size()) + " channels");
    files_.push_back({node.path(), {}});
    for (size_t c = 0; c < files.array_size(); ++c)
        files_.back().paths.push_back(resolved(files.element(c).text(), folder_));
    return range.low;
}

// {"wavelengths_nm": [...], "values": [...]} or, with a map for each, "files": one channel a wavelength,
// named "450nm".
Parameter ParameterParser::parse_spectrum(const JsonNode& node, const ParameterRange& range) {
    const bool maps = node.has("files");
    node.allow_keys({"wavelengths_nm", maps ? "files" : "values"});
    const JsonNode wavelengths = node.at("wavelengths_nm"), values_node = node.at(maps ? "files" : "values");
    claim_wavelengths(wavelengths);
    if (maps) return add_files(node, values_node, range);
    std::vector<double> values = numbers(values_node, range);
    if (values.size() != channels_.size())
        values_node.refuse("must have one value for each of the " + std::to_string(channels_.size()) +
                           " wavelengths");
    return values;
}

Parameter ParameterParser::parse(const JsonNode& node, const ParameterRange& range) {
    if (node.raw().is_number()) return node.number(range.low, range.high);
    if (node.has("file")) {
        node.allow_keys({"file"});
        files_.push_back({node.path(), {resolved(node.at("file").text(), folder_)}});
        return range.low;
    }
    if (!range.by_channel) node.refuse(allowed(range));
    if (node.raw().is_array()) {
        if (node.raw().size() != 3)
            node.refuse("must be [r, g, b], three numbers from " + number_text(range.low) + " to " +
                        number_text(range.high));
        claim_rgb(node);
        return numbers(node, range);
    }
    if (node.has("files") && !node.has("wavelengths_nm")) {
        node.allow_keys({"files"});
        claim_rgb(node);
        return add_files(node, node.at("files"), range);
    }
    if (node.raw().is_object()) return parse_spectrum(node, range);
    node.refuse(allowed(range));
}

}  // namespace gonio
