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

// The environment, if that is the light: a measurement has lights of its own, or it, and never both.
std::optional<EnvironmentSource> parse_light(const JsonNode& root, const MeasureKind& kind,
                                             const std::string& folder) {
    using Light = MeasureKind::Light;
    const auto environment = root.find("environment");
    if (kind.light == Light::directions) {
        if (environment)
            environment->refuse("a measurement of kind \"" + kind.name + "\" has lights of its own");
        return {};
    }
    if (kind.light == Light::either) {
        const JsonNode measure = root.at("measure");
        if (!environment) {
            measure.at("incident");
            return {};
        }
        if (const auto incident = measure.find("incident"))
            incident->refuse(
                "the environment is the light: leave one of \"incident\" and \"environment\" out");
    }
    return parse_environment(root.at("environment"), folder);
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
    const std::optional<EnvironmentSource> environment = parse_light(root, kind, origin.folder);
    MeasurePlan plan = kind.parse(measure, parse_accuracy(root.find("accuracy")));
    std::vector<OutputRequest> outputs = parse_outputs(root.find("output"), product_of(plan), origin.name);
    return {std::move(surface), std::move(material),           std::move(plan),
            std::move(outputs), parse_base(root.find("base")), environment};
}

SurfaceSource parse_surface_job(std::string_view text, const JobOrigin& origin) {
    const nlohmann::json document = parse_json_strictly(text);
    const JsonNode root(document);
    root.allow_keys({"surface"});
    return parse_surface(root.at("surface"), origin.folder);
}

}  // namespace gonio
