// "environment": {"radiance": 1} or {"file": "sky.hdr", ...}
#include "base/numeric.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

constexpr double most_radiance = 1e30;

std::vector<double> parse_radiance(const JsonNode& node) {
    if (node.raw().is_number()) return {node.number(0, most_radiance)};
    if (!node.raw().is_array() || node.raw().size() != 3)
        node.refuse("must be a number of at least 0, or [r, g, b]");
    std::vector<double> rgb;
    for (size_t c = 0; c < 3; ++c) rgb.push_back(node.element(c).number(0, most_radiance));
    return rgb;
}

}  // namespace

EnvironmentSource parse_environment(const JsonNode& node, const std::string& folder) {
    EnvironmentSource source;
    if (const auto radiance = node.find("radiance")) {
        node.allow_keys({"radiance"});
        source.radiance = parse_radiance(*radiance);
        return source;
    }
    node.allow_keys({"file", "layout", "rotation_deg", "scale"});
    source.path = resolved(node.at("file").text(), folder);
    if (const auto layout = node.find("layout"))
        source.layout = layout->choice({"equirectangular", "cube"}) == "cube"
                            ? EnvironmentLayout::cube
                            : EnvironmentLayout::equirectangular;
    if (const auto rotation = node.find("rotation_deg")) source.rotation_deg = rotation->number(-360, 360);
    if (const auto scale = node.find("scale")) {
        source.scale = scale->number();
        if (!(source.scale > 0)) scale->refuse("must be above 0");
    }
    return source;
}

int parse_azimuths(const JsonNode& node) {
    constexpr uint64_t fewest = 3, most = 1024;
    return static_cast<int>(node.whole_number(fewest, most));
}

}  // namespace gonio
