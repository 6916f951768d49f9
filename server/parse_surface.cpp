#include <climits>
#include <cmath>

#include "base/error.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

const std::vector<std::string> option_keys = {
    "width",  "depth",  "pitch", "pitch_x",  "pitch_y", "height_scale", "height_range", "height_offset",
    "invert", "y_axis", "crop",  "resample", "level",   "boundary",     "missing"};

std::vector<std::string> with_options(const std::string& source_key) {
    std::vector<std::string> keys{source_key};
    keys.insert(keys.end(), option_keys.begin(), option_keys.end());
    return keys;
}

std::optional<double> positive_length(const JsonNode& surface, const std::string& key) {
    const std::optional<JsonNode> node = surface.find(key);
    return node ? std::optional(node->positive_length()) : std::nullopt;
}

template <size_t n>
std::array<int, n> whole_numbers(const JsonNode& node, const std::array<int, n>& least,
                                 const std::string& allowed) {
    if (!node.raw().is_array() || node.raw().size() != n) node.refuse(allowed);
    std::array<int, n> values;
    for (size_t k = 0; k < n; ++k) {
        values[k] = static_cast<int>(node.element(k).whole_number(least[k], INT_MAX));
    }
    return values;
}

// Position in the list of names; the list is in the order of the enum.
template <class Enum>
void read_choice(const JsonNode& surface, const std::string& key, const std::vector<std::string>& names,
                 Enum& value) {
    const std::optional<JsonNode> node = surface.find(key);
    if (!node) return;
    const std::string name = node->choice(names);
    value = static_cast<Enum>(std::find(names.begin(), names.end(), name) - names.begin());
}

PrepareOptions parse_options(const JsonNode& surface) {
    PrepareOptions options;
    options.width = positive_length(surface, "width");
    options.depth = positive_length(surface, "depth");
    options.pitch_x = positive_length(surface, "pitch_x");
    options.pitch_y = positive_length(surface, "pitch_y");
    if (const auto pitch = surface.find("pitch")) {
        if (options.pitch_x || options.pitch_y)
            pitch->refuse("stands for pitch_x and pitch_y: give it or those two");
        options.pitch_x = options.pitch_y = pitch->positive_length();
    }
    options.height_scale = positive_length(surface, "height_scale");
    options.height_range = positive_length(surface, "height_range");
    if (const auto offset = surface.find("height_offset")) options.height_offset = offset->length();
    if (const auto invert = surface.find("invert")) options.invert = invert->boolean();
    if (const auto y_axis = surface.find("y_axis")) options.y_up = y_axis->choice({"up", "down"}) == "up";
    if (const auto crop = surface.find("crop")) {
        options.crop =
            whole_numbers<4>(*crop, {0, 0, 1, 1}, "must be [x, y, width, height] in stored columns and rows");
    }
    if (const auto resample = surface.find("resample")) {
        options.resample = whole_numbers<2>(*resample, {1, 1}, "must be [columns, rows]");
    }
    read_choice(surface, "level", {"none", "mean", "plane", "quadratic"}, options.level);
    read_choice(surface, "boundary", {"periodic", "mirror", "open"}, options.boundary);
    read_choice(surface, "missing", {"reject", "interpolate"}, options.missing);
    return options;
}

// Rows of numbers, all of one length; null marks a missing point.
RawHeights parse_grid(const JsonNode& grid) {
    RawHeights raw;
    raw.ny = static_cast<int>(grid.array_size());
    raw.nx = static_cast<int>(grid.element(0).array_size());
    raw.format = "inline grid";
    raw.values.reserve(static_cast<size_t>(raw.nx) * raw.ny);
    for (int j = 0; j < raw.ny; ++j) {
        const nlohmann::json& row = grid.raw()[j];
        if (!row.is_array() || row.size() != static_cast<size_t>(raw.nx)) {
            grid.element(j).refuse("must be a row of " + std::to_string(raw.nx) +
                                   " heights, as the first is");
        }
        for (int i = 0; i < raw.nx; ++i) {
            if (!row[i].is_number() && !row[i].is_null()) {
                grid.element(j).element(i).refuse("must be a number, or null for a missing point");
            }
            raw.values.push_back(row[i].is_null() ? std::nan("") : row[i].get<double>());
        }
    }
    return raw;
}

}  // namespace

SurfaceSource parse_surface(const JsonNode& surface, const std::string& folder) {
    const int n_sources = surface.has("file") + surface.has("generate") + surface.has("grid");
    if (n_sources != 1) {
        surface.refuse(R"(must be an object with exactly one of "file", "generate" and "grid")");
    }
    if (surface.has("generate")) return parse_generated_surface(surface);
    if (surface.has("grid")) {
        surface.allow_keys(with_options("grid"));
        return GridSurface{parse_grid(surface.at("grid")), parse_options(surface)};
    }
    surface.allow_keys(with_options("file"));
    return FileSurface{resolved(surface.at("file").text(), folder), parse_options(surface)};
}

}  // namespace gonio
