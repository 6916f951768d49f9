// "measure": {"kind": "btf", ...} and {"kind": "light_field", ...}
#include <algorithm>

#include "base/error.h"
#include "base/half.h"
#include "server/btf_file.h"
#include "server/canonical.h"
#include "server/job_sections.h"
#include "server/measure_kind.h"
#include "table/io/image_io.h"
#include "table/io/table_io.h"

namespace gonio {
namespace {

constexpr uint64_t max_pixels = 16384, max_pixel_samples = 256, max_cameras = 1024;

// What both kinds have in common.
void parse_pictures(const JsonNode& measure, const Accuracy& accuracy, BtfPlan& plan) {
    if (const auto pixels = measure.find("pixels")) {
        if (pixels->array_size() != 2) pixels->refuse("must be [columns, rows], two whole numbers");
        plan.pixels_x = static_cast<int>(pixels->element(0).whole_number(1, max_pixels));
        plan.pixels_y = static_cast<int>(pixels->element(1).whole_number(1, max_pixels));
    }
    if (const auto samples = measure.find("pixel_samples"))
        plan.pixel_samples = static_cast<int>(samples->whole_number(1, max_pixel_samples));
    if (const auto plane = measure.find("plane"))
        plan.plane = plane->choice({"top", "zero"}) == "top" ? BtfPlan::Plane::top : BtfPlan::Plane::zero;
    plan.max_order = parse_max_order(measure);
    plan.accuracy = accuracy;
}

BtfPlan parse_btf(const JsonNode& measure, const Accuracy& accuracy) {
    measure.allow_keys({"kind", "incident", "outgoing", "pixels", "pixel_samples", "plane", "max_order"});
    BtfPlan plan;
    plan.incident = parse_directions(measure.at("incident"));
    plan.outgoing = parse_directions(measure.at("outgoing"));
    parse_pictures(measure, accuracy, plan);
    return plan;
}

CameraPlane parse_cameras(const JsonNode& node) {
    node.allow_keys({"count", "width", "depth", "height"});
    const JsonNode count = node.at("count");
    if (count.array_size() != 2) count.refuse("must be [columns, rows], two whole numbers");
    CameraPlane cameras;
    cameras.n_u = static_cast<int>(count.element(0).whole_number(1, max_cameras));
    cameras.n_v = static_cast<int>(count.element(1).whole_number(1, max_cameras));
    cameras.width = node.at("width").positive_length();
    cameras.depth = node.has("depth") ? node.at("depth").positive_length() : cameras.width;
    cameras.height = node.at("height").positive_length();
    return cameras;
}

LightFieldPlan parse_light_field(const JsonNode& measure, const Accuracy& accuracy) {
    measure.allow_keys({"kind", "incident", "azimuths", "outgoing", "cameras", "pixels", "pixel_samples",
                        "plane", "max_order"});
    LightFieldPlan plan;
    if (const auto incident = measure.find("incident")) plan.incident = parse_directions(*incident);
    if (const auto azimuths = measure.find("azimuths")) {
        if (!plan.incident.empty()) azimuths->refuse("only an environment has azimuths: leave it out");
        plan.azimuths = parse_azimuths(*azimuths);
    }
    if (const auto cameras = measure.find("cameras")) {
        if (const auto outgoing = measure.find("outgoing"))
            outgoing->refuse(
                "a light field has directions or cameras: leave one of \"outgoing\" and \"cameras\" out");
        plan.cameras = parse_cameras(*cameras);
    } else {
        plan.outgoing = parse_directions(measure.at("outgoing"));
    }
    parse_pictures(measure, accuracy, plan);
    return plan;
}

nlohmann::json canonical_plan(const BtfPlan& plan, const char* kind) {
    nlohmann::json j{
        {"kind", kind},
        {"pixel_samples", plan.pixel_samples},
        {"plane", plan.plane == BtfPlan::Plane::top ? "top" : "zero"},
        {"max_order", plan.max_order == 0 ? nlohmann::json("all") : nlohmann::json(plan.max_order)},
        {"accuracy", canonical(plan.accuracy)}};
    if (plan.incident.empty())
        j["azimuths"] = plan.azimuths;
    else
        j["incident"] = canonical(plan.incident);
    if (plan.cameras) {
        const CameraPlane& c = *plan.cameras;
        j["cameras"] = {
            {"count", {c.n_u, c.n_v}}, {"width_m", c.width}, {"depth_m", c.depth}, {"height_m", c.height}};
    } else {
        j["outgoing"] = canonical(plan.outgoing);
    }
    if (plan.pixels_x > 0) j["pixels"] = {plan.pixels_x, plan.pixels_y};
    return j;
}

Prediction predict(const LoadedJob& job) {
    return predict_btf(job.surface.surface, job.material, pictures_of(job));
}

size_t nearest(const std::vector<AnglesDeg>& directions, const AnglesDeg& wanted) {
    const Vec3 w = to_vector(wanted);
    const auto towards = [&](const AnglesDeg& a) { return dot(to_vector(a), w); };
    return std::max_element(directions.begin(), directions.end(),
                            [&](const AnglesDeg& a, const AnglesDeg& b) { return towards(a) < towards(b); }) -
           directions.begin();
}

// For looking: the view nearest the normal, or the middle camera.
size_t preview_view(const BtfPlan& plan) {
    if (plan.cameras)
        return static_cast<size_t>(plan.cameras->n_v / 2) * plan.cameras->n_u + plan.cameras->n_u / 2;
    return nearest(plan.outgoing, {0, 0});
}

// images: [light][channel][pixel] of that view. Under the light nearest 45 degrees from the upper left, or
// the environment; white is a white plane.
void write_preview(const LoadedJob& job, const BtfShape& shape, const std::vector<uint16_t>& images,
                   const std::string& path) {
    const size_t light = job.environment ? 0 : nearest(pictures_of(job).incident, {45, 135});
    PngChannels picture;
    picture.width = shape.pixels_x;
    picture.height = shape.pixels_y;
    picture.scale = pi;
    picture.attributes = job_provenance(job);
    std::vector<std::vector<float>> channels(shape.n_channels == 3 ? 3 : 1);
    for (size_t c = 0; c < channels.size(); ++c) {
        const size_t channel = channels.size() == 3 ? c : shape.n_channels / 2;
        const uint16_t* image = &images[(light * shape.n_channels + channel) * shape.n_pixels()];
        for (size_t p = 0; p < shape.n_pixels(); ++p) channels[c].push_back(from_half_bits(image[p]));
    }
    for (const auto& channel : channels) picture.channels.push_back(channel.data());
    write_png_picture(picture, path);
}

void write_means(const LoadedJob& job, const Table& mean, const OutputRequest& file) {
    Table table = mean;
    const auto origin = job_provenance(job);
    table.provenance.insert(table.provenance.begin(), origin.begin(), origin.end());
    write_table(table, file.format, file.path);
}

// What the facets send back depends on the view.
Report run_glossy(const LoadedJob& job, const std::vector<OutputRequest>& files, const RunOptions& options,
                  const Monitor& monitor) {
    for (const OutputRequest& file : files)
        if (file.format == "btf")
            throw Error(ErrorCode::invalid_input, "/output", "btf",
                        "the factored form holds one radiance for each facet and light, and a glossy facet "
                        "sends another to every view: ask for \"images\" or \"npy\"");
    const BtfPlan& plan = pictures_of(job);
    GlossyBtf glossy(job.surface.surface, job.material, plan, options, monitor,
                     job.environment ? &*job.environment : nullptr);
    const int shown = static_cast<int>(preview_view(plan));
    std::vector<uint16_t> preview;
    const auto keep_preview = [&](int view, std::span<const uint16_t> images) {
        if (view == shown) preview.assign(images.begin(), images.end());
    };
    Btf btf = write_glossy_images(job, glossy, files, keep_preview);
    btf.mean.provenance = glossy.report().settings;
    for (const OutputRequest& file : files) {
        monitor.check_cancelled();
        if (file.format == "png")
            write_preview(job, btf.shape, preview, file.path);
        else if (!image_form(file.format))
            write_means(job, btf.mean, file);
    }
    return glossy.report();
}

Report run(const LoadedJob& job, const std::vector<OutputRequest>& files, const RunOptions& options,
           const Monitor& monitor) {
    if (!pure_lambertian(job.material)) return run_glossy(job, files, options, monitor);
    BtfResult result = measure_btf(job.surface.surface, job.material, pictures_of(job), options, monitor,
                                   job.environment ? &*job.environment : nullptr);
    Table& mean = result.btf.mean;
    mean.provenance = result.report.settings;
    for (const OutputRequest& file : files) {
        monitor.check_cancelled();
        if (file.format == "btf") {
            write_factored_btf(job, result.btf, file.path);
        } else if (const auto form = image_form(file.format)) {
            write_btf_images(job, result.btf, *form, file.path, monitor);
        } else if (file.format == "png") {
            const BtfShape& shape = result.btf.shape;
            std::vector<uint16_t> images(shape.images_size() / shape.n_views);
            expand_view(shape, result.btf.radiance, result.btf.view_maps,
                        static_cast<int>(preview_view(pictures_of(job))), images);
            write_preview(job, shape, images, file.path);
        } else {
            write_means(job, mean, file);
        }
    }
    return std::move(result.report);
}

// Pictures in their smaller form, where there is one.
bool is_served(const LoadedJob& job, const std::string& format) {
    const bool has_factored_form = pure_lambertian(job.material) != nullptr;
    return has_factored_form ? !image_form(format) : format != "btf";
}

}  // namespace

MeasureKind btf_kind() {
    return {"btf",
            "btf",
            {"btf", "images", "npy", "png", "csv", "json"},
            [](const JsonNode& measure, const Accuracy& accuracy) -> MeasurePlan {
                return parse_btf(measure, accuracy);
            },
            [](const MeasurePlan& plan) { return canonical_plan(std::get<BtfPlan>(plan), "btf"); },
            predict,
            run,
            MeasureKind::Light::directions,
            is_served};
}

MeasureKind light_field_kind() {
    return {
        "light_field",
        "light_field",
        {"btf", "images", "npy", "png"},
        [](const JsonNode& measure, const Accuracy& accuracy) -> MeasurePlan {
            return parse_light_field(measure, accuracy);
        },
        [](const MeasurePlan& plan) { return canonical_plan(std::get<LightFieldPlan>(plan), "light_field"); },
        predict,
        run,
        MeasureKind::Light::either,
        is_served};
}

}  // namespace gonio
