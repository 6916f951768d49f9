// "measure": {"kind": "maps", ...}
#include <algorithm>
#include <cmath>
#include <ostream>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/text.h"
#include "server/array_file.h"
#include "server/canonical.h"
#include "server/job_sections.h"
#include "server/measure_kind.h"
#include "server/npy_file.h"
#include "table/io/image_io.h"

namespace gonio {
namespace {

constexpr size_t max_layers = 4096;
constexpr uint64_t max_sky_directions = 1 << 16;

MeasurePlan parse(const JsonNode& measure, const Accuracy& accuracy) {
    measure.allow_keys({"kind", "incident", "outgoing", "sky_directions", "max_order"});
    MapsPlan plan;
    if (const auto lights = measure.find("incident")) plan.incident = parse_directions(*lights);
    if (const auto views = measure.find("outgoing")) plan.outgoing = parse_directions(*views);
    if (const auto sky = measure.find("sky_directions"))
        plan.sky_directions = static_cast<int>(sky->whole_number(0, max_sky_directions));
    if (plan.incident.empty() && plan.outgoing.empty() && plan.sky_directions == 0)
        measure.refuse("asks for nothing: \"incident\", \"outgoing\" or \"sky_directions\" is needed");
    if (const size_t n = plan.incident.size() + plan.outgoing.size(); n > max_layers)
        throw Error(ErrorCode::limit, measure.path(), std::to_string(n) + " lights and views",
                    "at most " + std::to_string(max_layers));
    plan.max_order = parse_max_order(measure);
    plan.accuracy = accuracy;
    return plan;
}

nlohmann::json canonical_plan(const MeasurePlan& any) {
    const auto& plan = std::get<MapsPlan>(any);
    return {{"kind", "maps"},
            {"incident", canonical(plan.incident)},
            {"outgoing", canonical(plan.outgoing)},
            {"sky_directions", plan.sky_directions},
            {"max_order", plan.max_order == 0 ? nlohmann::json("all") : nlohmann::json(plan.max_order)},
            {"accuracy", canonical(plan.accuracy)}};
}

Prediction predict(const LoadedJob& job) {
    return predict_maps(job.surface.surface, job.material, std::get<MapsPlan>(job.job.plan));
}

const char* const quantity =
    "direct, indirect, total: exitance over the irradiance of the flat base plane (a white plane is 1); "
    "shadow, "
    "mask: share of a cell that the light reaches or the viewer sees; sky: cosine-weighted share of the "
    "upper "
    "hemisphere that is seen (1 on a plane). One pixel a cell, the mean of its facets by projected area";

// Behind it, where what leaves a facet depends on the view.
const char* const quantity_of_glossy =
    ". The facets are glossy: direct, indirect, total are irradiances (of what arrives) over that of the "
    "flat "
    "base plane";

using Attributes = std::vector<std::pair<std::string, std::string>>;

Attributes attributes_of(const LoadedJob& job, const MapsResult& result) {
    Attributes attributes = job_provenance(job);
    attributes.insert(attributes.end(), result.report.settings.begin(), result.report.settings.end());
    attributes.emplace_back(
        "quantity", pure_lambertian(job.material) ? quantity : std::string(quantity) + quantity_of_glossy);
    const auto& plan = std::get<MapsPlan>(job.job.plan);
    const auto name_directions = [&](const std::string& what, const std::vector<AnglesDeg>& directions) {
        for (size_t k = 0; k < directions.size(); ++k)
            attributes.emplace_back(
                what + std::to_string(k) + "_deg",
                number_text(directions[k].theta_deg) + " " + number_text(directions[k].phi_deg));
    };
    name_directions("light", plan.incident);
    name_directions("view", plan.outgoing);
    for (const MapLayer& layer : result.maps.layers)
        attributes.emplace_back(layer.name, "mean " + number_text(layer.mean, 6) +
                                                ", standard error of a pixel " + number_text(layer.se, 3));
    return attributes;
}

void write_exr(const LoadedJob& job, const MapsResult& result, const std::string& path) {
    Picture picture;
    picture.width = result.maps.nx;
    picture.height = result.maps.ny;
    picture.attributes = attributes_of(job, result);
    for (const MapLayer& layer : result.maps.layers) {
        const size_t dot = layer.name.rfind('.');
        const bool is_light = std::count(layer.name.begin(), layer.name.end(), '.') >= 2;
        picture.channels.push_back(
            {is_light ? layer.name.substr(0, dot + 1) + exr_channel_name(layer.name.substr(dot + 1))
                      : layer.name + ".Y",
             layer.pixels});
    }
    write_exr_picture(picture, path);
}

// All layers on one sheet, for looking; row by row from the top left in the order of the other formats.
void write_sheet(const LoadedJob& job, const MapsResult& result, const std::string& path) {
    constexpr size_t most_shown = 256, gap = 2, most_pixels = size_t{1} << 26;
    const Maps& maps = result.maps;
    const size_t n = std::min(most_shown, maps.layers.size());
    const size_t columns = static_cast<size_t>(std::ceil(std::sqrt(static_cast<double>(n)))),
                 rows = (n + columns - 1) / columns;
    size_t step = 1;
    while (n * (maps.nx / step) * (maps.ny / step) > most_pixels) ++step;
    const size_t width = std::max<size_t>(1, maps.nx / step), height = std::max<size_t>(1, maps.ny / step);
    PngChannels sheet;
    sheet.width = static_cast<int>(columns * (width + gap) - gap);
    sheet.height = static_cast<int>(rows * (height + gap) - gap);
    sheet.attributes = attributes_of(job, result);
    std::vector<float> pixels(static_cast<size_t>(sheet.width) * sheet.height, 0.5f);
    for (size_t k = 0; k < n; ++k) {
        const size_t x0 = k % columns * (width + gap), y0 = (rows - 1 - k / columns) * (height + gap);
        for (size_t j = 0; j < height; ++j)
            for (size_t i = 0; i < width; ++i)
                pixels[(y0 + j) * sheet.width + x0 + i] =
                    maps.layers[k].pixels[j * step * maps.nx + i * step];
    }
    sheet.channels = {pixels.data()};
    write_png_picture(sheet, path);
}

// What the numbers are, and the mean of every layer.
nlohmann::ordered_json head_of(const LoadedJob& job, const MapsResult& result) {
    nlohmann::ordered_json head{{"format", "gonio maps"}, {"version", 1}};
    for (const auto& [key, value] : attributes_of(job, result)) head[key] = value;
    head["pixel_pitch_m"] = {job.surface.surface.pitch_x, job.surface.surface.pitch_y};
    head["first_pixel"] = "row 0 at low y, column 0 at low x";
    nlohmann::ordered_json names = nlohmann::ordered_json::array(), means = names, errors = names;
    for (const MapLayer& layer : result.maps.layers) {
        names.push_back(layer.name);
        means.push_back(layer.mean);
        errors.push_back(layer.se);
    }
    head["layers"] = names;
    head["mean"] = means;
    head["pixel_se"] = errors;
    return head;
}

std::vector<size_t> shape_of(const Maps& maps) {
    return {maps.layers.size(), static_cast<size_t>(maps.ny), static_cast<size_t>(maps.nx)};
}

void write_arrays(const LoadedJob& job, const MapsResult& result, const std::string& path) {
    write_array_file(path, head_of(job, result), {{"maps", "<f4", shape_of(result.maps)}},
                     [&](ArrayWriter& writer) {
                         for (const MapLayer& layer : result.maps.layers)
                             writer.append(std::span<const float>(layer.pixels));
                     });
}

void write_npy(const LoadedJob& job, const MapsResult& result, const std::string& path) {
    write_npy_file(path, "'<f4'", shape_of(result.maps), [&](std::ostream& out) {
        for (const MapLayer& layer : result.maps.layers)
            out.write(reinterpret_cast<const char*>(layer.pixels.data()),
                      static_cast<std::streamsize>(layer.pixels.size() * sizeof(float)));
        return head_of(job, result);
    });
}

Report run(const LoadedJob& job, const std::vector<OutputRequest>& files, const RunOptions& options,
           const Monitor& monitor) {
    MapsResult result =
        measure_maps(job.surface.surface, job.material, std::get<MapsPlan>(job.job.plan), options, monitor);
    for (const OutputRequest& file : files) {
        monitor.check_cancelled();
        if (file.format == "exr")
            write_exr(job, result, file.path);
        else if (file.format == "png")
            write_sheet(job, result, file.path);
        else if (file.format == "npy")
            write_npy(job, result, file.path);
        else if (file.format == "json")
            write_file_atomically(file.path,
                                  [&](std::ostream& out) { out << head_of(job, result).dump(1) << "\n"; });
        else
            write_arrays(job, result, file.path);
    }
    return std::move(result.report);
}

}  // namespace

MeasureKind maps_kind() {
    return {"maps", "maps", {"exr", "png", "arrays", "npy", "json"}, parse, canonical_plan, predict, run};
}

}  // namespace gonio
