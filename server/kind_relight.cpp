// "measure": {"kind": "relight", ...}: under the "environment" of the job.
#include <algorithm>
#include <ostream>

#include "base/atomic_file.h"
#include "base/text.h"
#include "measure/relight.h"
#include "server/array_file.h"
#include "server/canonical.h"
#include "server/job_sections.h"
#include "server/measure_kind.h"
#include "server/npy_file.h"
#include "table/io/image_io.h"

namespace gonio {
namespace {

constexpr uint64_t max_pixels = 16384;

MeasurePlan parse(const JsonNode& measure, const Accuracy& accuracy) {
    measure.allow_keys({"kind", "outgoing", "azimuths", "pixels", "plane", "max_order"});
    RelightPlan plan;
    plan.outgoing = parse_directions(measure.at("outgoing"));
    if (const auto azimuths = measure.find("azimuths")) plan.azimuths = parse_azimuths(*azimuths);
    if (const auto pixels = measure.find("pixels")) {
        if (pixels->array_size() != 2) pixels->refuse("must be [columns, rows], two whole numbers");
        plan.pixels_x = static_cast<int>(pixels->element(0).whole_number(1, max_pixels));
        plan.pixels_y = static_cast<int>(pixels->element(1).whole_number(1, max_pixels));
    }
    if (const auto plane = measure.find("plane"))
        plan.plane =
            plane->choice({"top", "zero"}) == "top" ? RelightPlan::Plane::top : RelightPlan::Plane::zero;
    plan.max_order = parse_max_order(measure);
    plan.accuracy = accuracy;
    return plan;
}

nlohmann::json canonical_plan(const MeasurePlan& any) {
    const auto& plan = std::get<RelightPlan>(any);
    nlohmann::json j{
        {"kind", "relight"},
        {"outgoing", canonical(plan.outgoing)},
        {"azimuths", plan.azimuths},
        {"plane", plan.plane == RelightPlan::Plane::top ? "top" : "zero"},
        {"max_order", plan.max_order == 0 ? nlohmann::json("all") : nlohmann::json(plan.max_order)},
        {"accuracy", canonical(plan.accuracy)}};
    if (plan.pixels_x > 0) j["pixels"] = {plan.pixels_x, plan.pixels_y};
    return j;
}

Prediction predict(const LoadedJob& job) {
    return predict_relight(job.surface.surface, job.material, std::get<RelightPlan>(job.job.plan));
}

const char* const quantity =
    "exit radiance in the unit of the environment: of every facet, of the pixels of every view, and averaged "
    "over the surface as each view sees it (mean, with its standard error se and its bias)";

using Attributes = std::vector<std::pair<std::string, std::string>>;

Attributes attributes_of(const LoadedJob& job, const RelightResult& result) {
    Attributes attributes = job_provenance(job);
    attributes.emplace_back("environment_hash", environment_hash(*job.environment));
    attributes.insert(attributes.end(), result.report.settings.begin(), result.report.settings.end());
    attributes.emplace_back("quantity", quantity);
    return attributes;
}

// One layer a view: "view000.R".
void write_exr(const LoadedJob& job, const RelightResult& result, const std::string& path) {
    const Relit& relit = result.relit;
    const auto& views = std::get<RelightPlan>(job.job.plan).outgoing;
    Picture picture;
    picture.width = relit.pixels_x;
    picture.height = relit.pixels_y;
    picture.attributes = attributes_of(job, result);
    const size_t n_pixels = static_cast<size_t>(relit.pixels_x) * relit.pixels_y;
    for (int v = 0; v < relit.n_views; ++v) {
        const std::string digits = std::to_string(v),
                          name = "view" + std::string(3 - std::min<size_t>(3, digits.size()), '0') + digits;
        picture.attributes.emplace_back(
            name + "_deg", number_text(views[v].theta_deg) + " " + number_text(views[v].phi_deg));
        for (int c = 0; c < relit.n_channels; ++c) {
            const float* from = &relit.images[(static_cast<size_t>(v) * relit.n_channels + c) * n_pixels];
            picture.channels.push_back(
                {name + "." + exr_channel_name(job.material.channels[c]), {from, from + n_pixels}});
        }
    }
    write_exr_picture(picture, path);
}

// For looking: the view nearest the normal; white is its brightest value but for one pixel in a hundred.
void write_preview(const LoadedJob& job, const RelightResult& result, const std::string& path) {
    const Relit& relit = result.relit;
    const auto& views = std::get<RelightPlan>(job.job.plan).outgoing;
    const auto view =
        std::min_element(views.begin(), views.end(),
                         [](const AnglesDeg& a, const AnglesDeg& b) { return a.theta_deg < b.theta_deg; }) -
        views.begin();
    const size_t n_pixels = static_cast<size_t>(relit.pixels_x) * relit.pixels_y;
    const float* image = &relit.images[static_cast<size_t>(view) * relit.n_channels * n_pixels];
    std::vector<float> sorted(image, image + relit.n_channels * n_pixels);
    const auto white = sorted.begin() + static_cast<long>(sorted.size() * 99 / 100);
    std::nth_element(sorted.begin(), white, sorted.end());
    PngChannels picture;
    picture.width = relit.pixels_x;
    picture.height = relit.pixels_y;
    picture.scale = *white > 0 ? 1.0 / *white : 1.0;
    picture.attributes = attributes_of(job, result);
    if (relit.n_channels == 3)
        picture.channels = {image, image + n_pixels, image + 2 * n_pixels};
    else
        picture.channels = {image + relit.n_channels / 2 * n_pixels};
    write_png_picture(picture, path);
}

nlohmann::ordered_json means_of(const LoadedJob& job, const RelightResult& result) {
    const Relit& relit = result.relit;
    const auto& views = std::get<RelightPlan>(job.job.plan).outgoing;
    nlohmann::ordered_json head{{"format", "gonio relight"}, {"version", 1}};
    for (const auto& [key, value] : attributes_of(job, result)) head[key] = value;
    head["channels"] = job.material.channels;
    head["outgoing_deg"] = canonical(views);
    const auto planes = [&](const std::vector<double>& values) {
        nlohmann::ordered_json list = nlohmann::ordered_json::array();
        for (int c = 0; c < relit.n_channels; ++c)
            list.push_back(std::vector<double>(values.begin() + c * relit.n_views,
                                               values.begin() + (c + 1) * relit.n_views));
        return list;
    };
    head["mean"] = planes(relit.mean);
    head["se"] = planes(relit.se);
    head["bias"] = planes(relit.bias);
    head["facet_se"] = relit.radiance_se;
    return head;
}

std::vector<size_t> images_shape(const Relit& relit) {
    const auto size = [](int n) { return static_cast<size_t>(n); };
    return {size(relit.n_views), size(relit.n_channels), size(relit.pixels_y), size(relit.pixels_x)};
}

// One radiance a facet, or, of glossy ones, one for every view.
std::vector<size_t> facets_shape(const Relit& relit) {
    const auto channels = static_cast<size_t>(relit.n_channels);
    if (relit.radiance.size() == channels * relit.n_facets) return {channels, relit.n_facets};
    return {channels, static_cast<size_t>(relit.n_views), relit.n_facets};
}

void write_csv(const LoadedJob& job, const RelightResult& result, const std::string& path) {
    const Relit& relit = result.relit;
    const auto& views = std::get<RelightPlan>(job.job.plan).outgoing;
    std::string text;
    for (const auto& [key, value] : attributes_of(job, result)) text += "# " + key + ": " + value + "\n";
    text += "theta_o_deg,phi_o_deg,channel,radiance,se,bias\n";
    for (int c = 0; c < relit.n_channels; ++c)
        for (int v = 0; v < relit.n_views; ++v) {
            const size_t at = static_cast<size_t>(c) * relit.n_views + v;
            text += number_text(views[v].theta_deg) + "," + number_text(views[v].phi_deg) + "," +
                    job.material.channels[c] + "," + number_text(relit.mean[at]) + "," +
                    number_text(relit.se[at]) + "," + number_text(relit.bias[at]) + "\n";
        }
    write_file_atomically(path, [&](std::ostream& out) { out << text; });
}

void write_npy(const LoadedJob& job, const RelightResult& result, const std::string& path) {
    write_npy_file(path, "'<f4'", images_shape(result.relit), [&](std::ostream& out) {
        out.write(reinterpret_cast<const char*>(result.relit.images.data()),
                  static_cast<std::streamsize>(result.relit.images.size() * sizeof(float)));
        return means_of(job, result);
    });
}

// Everything: means in the first line, then the images and the radiance of every facet part.
void write_arrays(const LoadedJob& job, const RelightResult& result, const std::string& path) {
    const Relit& relit = result.relit;
    const std::vector<ArraySection> sections = {{"images", "<f4", images_shape(relit)},
                                                {"facet_radiance", "<f4", facets_shape(relit)}};
    write_array_file(path, means_of(job, result), sections, [&](ArrayWriter& writer) {
        writer.append(std::span<const float>(relit.images));
        writer.append(std::span<const float>(relit.radiance));
    });
}

Report run(const LoadedJob& job, const std::vector<OutputRequest>& files, const RunOptions& options,
           const Monitor& monitor) {
    RelightResult result = measure_relight(job.surface.surface, job.material, *job.environment,
                                           std::get<RelightPlan>(job.job.plan), options, monitor);
    for (const OutputRequest& file : files) {
        monitor.check_cancelled();
        if (file.format == "exr")
            write_exr(job, result, file.path);
        else if (file.format == "png")
            write_preview(job, result, file.path);
        else if (file.format == "csv")
            write_csv(job, result, file.path);
        else if (file.format == "json")
            write_file_atomically(file.path,
                                  [&](std::ostream& out) { out << means_of(job, result).dump(1) << "\n"; });
        else if (file.format == "npy")
            write_npy(job, result, file.path);
        else
            write_arrays(job, result, file.path);
    }
    return std::move(result.report);
}

}  // namespace

MeasureKind relight_kind() {
    return {"relight",
            "relight",
            {"csv", "json", "exr", "png", "arrays", "npy"},
            parse,
            canonical_plan,
            predict,
            run,
            MeasureKind::Light::environment};
}

}  // namespace gonio
