// {"generate": NAME, ...}: one entry a generator of core/surface/generate.h. Ranges that involve two keys are
// the generators' own to check; load_job() puts "/surface" before their fields.
#include <algorithm>

#include "server/job_sections.h"
#include "surface/generate.h"

namespace gonio {
namespace {

int samples(const JsonNode& surface, const std::string& key = "samples") {
    return static_cast<int>(surface.at(key).whole_number(1, 1 << 16));
}
double length(const JsonNode& surface, const std::string& key) {
    return surface.at(key).positive_length();
}
double angle(const JsonNode& surface, const std::string& key, double high) {
    return surface.at(key).number(0, high);
}

struct Generator {
    std::string name;
    std::vector<std::string> keys;  // beside "generate"
    // Reads every key now, so that a bad one is refused by parse_job, and generates later.
    std::function<HeightField()> (*parse)(const JsonNode& surface);
};

using Generate = std::function<HeightField()>;

const std::vector<Generator> generators = {
    {"plane",
     {"samples", "pitch"},
     [](const JsonNode& s) -> Generate {
         return [n = samples(s), pitch = length(s, "pitch")] { return generate_plane(n, pitch); };
     }},
    {"v_groove",
     {"samples", "period", "slope_deg"},
     [](const JsonNode& s) -> Generate {
         return [n = samples(s), period = length(s, "period"), slope_deg = angle(s, "slope_deg", 89.99)] {
             return generate_v_groove(n, period, slope_deg);
         };
     }},
    {"rectangular_groove",
     {"samples", "period", "groove_width", "groove_depth"},
     [](const JsonNode& s) -> Generate {
         return [n = samples(s), period = length(s, "period"), width = length(s, "groove_width"),
                 depth = length(s, "groove_depth")] {
             return generate_rectangular_groove(n, period, width, depth);
         };
     }},
    {"sinusoid",
     {"samples", "period", "amplitude"},
     [](const JsonNode& s) -> Generate {
         return [n = samples(s), period = length(s, "period"), amplitude = length(s, "amplitude")] {
             return generate_sinusoid(n, period, amplitude);
         };
     }},
    {"egg_crate",
     {"samples", "period", "amplitude"},
     [](const JsonNode& s) -> Generate {
         return [n = samples(s), period = length(s, "period"), amplitude = length(s, "amplitude")] {
             return generate_egg_crate(n, period, amplitude);
         };
     }},
    {"spherical_pits",
     {"samples", "period", "radius", "eta_deg"},
     [](const JsonNode& s) -> Generate {
         return [n = samples(s), period = length(s, "period"), radius = length(s, "radius"),
                 eta_deg = angle(s, "eta_deg", 90)] {
             return generate_spherical_pits(n, period, radius, eta_deg);
         };
     }},
    {"gaussian",
     {"samples", "samples_y", "pitch", "correlation_length", "rms_slope", "seed"},
     [](const JsonNode& s) -> Generate {
         return [nx = samples(s), ny = samples(s, s.has("samples_y") ? "samples_y" : "samples"),
                 pitch = length(s, "pitch"), correlation_length = length(s, "correlation_length"),
                 rms_slope = s.at("rms_slope").number(0, 1000),
                 seed = s.has("seed") ? s.at("seed").whole_number(0, UINT64_MAX) : 1] {
             return generate_gaussian(nx, ny, pitch, correlation_length, rms_slope, seed);
         };
     }},
};

}  // namespace

GeneratedSurface parse_generated_surface(const JsonNode& surface) {
    std::vector<std::string> names;
    for (const Generator& generator : generators) names.push_back(generator.name);
    const std::string name = surface.at("generate").choice(names);
    const Generator& generator = generators[std::find(names.begin(), names.end(), name) - names.begin()];
    std::vector<std::string> keys{"generate"};
    keys.insert(keys.end(), generator.keys.begin(), generator.keys.end());
    surface.allow_keys(keys);
    return {name, generator.parse(surface)};
}

}  // namespace gonio
