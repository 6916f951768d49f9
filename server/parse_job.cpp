#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "server/job_sections.h"
#include "server/measure_kind.h"

namespace gonio {
namespace {

const MeasureKind& parse_kind(const JsonNode& measure) {
    std::vector<std::string> names;
    for (const MeasureKind& kind : measure_kinds()) names.push_back(kind.name);
    const std::string name = measure.at("kind").choice(names);
    return measure_kinds()[std::find(names.begin(), names.end(), name) - names.begin()];
}

std::vector<OutputRequest> parse_outputs(const std::optional<JsonNode>& node, const Product& product,
                                         const std::string& job_name) {
    if (!node) return {{product.formats[0], job_name + "." + product.formats[0]}};
    std::vector<OutputRequest> outputs(node->array_size());
    for (size_t i = 0; i < outputs.size(); ++i) {
        const JsonNode entry = node->element(i);
        entry.allow_keys({"format", "path"});
        outputs[i].format = entry.at("format").choice(product.formats);
        const std::optional<JsonNode> path = entry.find("path");
        outputs[i].path = path ? path->text() : job_name + "." + outputs[i].format;
        for (size_t earlier = 0; earlier < i; ++earlier) {
            if (outputs[earlier].path == outputs[i].path) {
                throw Error(ErrorCode::invalid_input, entry.path() + "/path", outputs[i].path,
                            "output " + std::to_string(earlier) + " is written there already");
            }
        }
    }
    return outputs;
}

}  // namespace

std::string resolved(const std::string& path, const std::string& folder) {
    return (std::filesystem::path(folder) / path).lexically_normal().string();
}

Job parse_job(std::string_view text, const JobOrigin& origin) {
    const nlohmann::json document = parse_json_strictly(text);
    const JsonNode root(document);
    root.allow_keys({"surface", "base", "material", "environment", "measure", "accuracy", "output"});
    SurfaceSource surface = parse_surface(root.at("surface"), origin.folder);
    MaterialSource material = parse_material(root.at("material"), origin.folder);
    const JsonNode measure = root.at("measure");
    const MeasureKind& kind = parse_kind(measure);
    std::optional<EnvironmentSource> environment;
    if (kind.under_environment)
        environment = parse_environment(root.at("environment"), origin.folder);
    else if (const auto unused = root.find("environment"))
        unused->refuse("a measurement of kind \"" + kind.name + "\" has lights of its own");
    MeasurePlan plan = kind.parse(measure, parse_accuracy(root.find("accuracy")));
    std::vector<OutputRequest> outputs = parse_outputs(root.find("output"), product_of(plan), origin.name);
    return {std::move(surface),
            std::move(material),
            std::move(plan),
            std::move(outputs),
            parse_base(root.find("base")),
            std::move(environment)};
}

SurfaceSource parse_surface_job(std::string_view text, const JobOrigin& origin) {
    const nlohmann::json document = parse_json_strictly(text);
    const JsonNode root(document);
    root.allow_keys({"surface"});
    return parse_surface(root.at("surface"), origin.folder);
}

}  // namespace gonio
