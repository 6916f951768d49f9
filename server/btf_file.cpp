#include "server/btf_file.h"

#include <algorithm>

#include "base/error.h"
#include "server/array_file.h"
#include "server/json_node.h"
#include "server/npy_file.h"

namespace gonio {
namespace {

using nlohmann::ordered_json;

constexpr int btf_format_version = 1;

ordered_json angles(const std::vector<AnglesDeg>& directions) {
    ordered_json list = ordered_json::array();
    for (const AnglesDeg& a : directions) list.push_back({a.theta_deg, a.phi_deg});
    return list;
}

ordered_json head_of(const LoadedJob& job, const Btf& btf) {
    const BtfPlan& plan = pictures_of(job);
    const bool is_light_field = std::holds_alternative<LightFieldPlan>(job.job.plan);
    const HeightField& s = job.surface.surface;
    ordered_json head{{"format", "gonio btf"},
                      {"content", is_light_field ? "light field" : "btf"},
                      {"version", btf_format_version},
                      {"form", "factored"}};
    for (const auto& [key, value] : job_provenance(job)) head[key] = value;
    for (const auto& [key, value] : btf.mean.provenance) head[key] = value;
    head["quantity"] =
        "apparent BRDF of a pixel, L / (E0 cos_i) in 1/sr: the radiance L that its view ray meets over the "
        "irradiance of the flat base plane; no other cosine";
    if (job.environment)
        head["quantity"] =
            "L / E in 1/sr: the radiance L that the view ray of a pixel meets over "
            "the environment's irradiance E of the flat base plane, its channel of `irradiance`";
    head["angles"] = "degrees; theta from the normal +z, phi from +x (along columns) towards +y (along rows)";
    head["channels"] = btf.mean.channels;
    if (job.environment) {
        head["environment_hash"] = environment_hash(*job.environment);
        const Environment sky = for_channels(*job.environment, btf.shape.n_channels);
        head["irradiance"] = ordered_json::array();
        for (int c = 0; c < sky.n_channels; ++c) head["irradiance"].push_back(horizontal_irradiance(sky, c));
        head["irradiance_says"] =
            "of the flat base plane, in the unit of the environment's radiance times sr";
    } else {
        head["incident_deg"] = angles(plan.incident);
    }
    if (plan.cameras) {
        ordered_json places = ordered_json::array();
        for (const Vec3& place : camera_places(s, plan)) places.push_back({place.x, place.y, place.z});
        head["cameras_m"] = std::move(places);
        head["cameras"] = {plan.cameras->n_u, plan.cameras->n_v};
        head["cameras_say"] =
            "places of the cameras: x, y of the surface, z above its mean height; the first "
            "number of `cameras` runs fastest";
    } else {
        head["outgoing_deg"] = angles(plan.outgoing);
    }
    head["n_views"] = btf.shape.n_views;
    const BtfShape& shape = btf.shape;
    head["pixels"] = {shape.pixels_x, shape.pixels_y};
    head["pixel_samples"] = shape.pixel_samples;
    head["n_facets"] = shape.n_facets;
    head["pixel_pitch_m"] = {(s.nx - 2 * s.border_x) * s.pitch_x / shape.pixels_x,
                             (s.ny - 2 * s.border_y) * s.pitch_y / shape.pixels_y};
    head["first_pixel"] = "row 0 at low y, column 0 at low x";
    head["plane"] = plan.plane == BtfPlan::Plane::top ? "top" : "zero";
    head["plane_says"] =
        plan.plane == BtfPlan::Plane::top
            ? "a view ray belongs to the pixel where it passes the plane of the highest point of the relief"
            : "a view ray belongs to the pixel where it passes the plane of height 0 of the surface as given";
    head["errors"] =
        "mean_se: standard error of a mean over the pixels; mean_bias: what the places of the pixels and the "
        "orders left out may do to it, and a guess of what irradiance does that is constant over a facet "
        "part; "
        "pixel_se: standard error of one pixel, rms over the relief";
    return head;
}

std::vector<ArraySection> small_arrays(const BtfShape& shape) {
    const size_t c = shape.n_channels, l = shape.n_lights, v = shape.n_views;
    return {{"mean", "<f4", {c, l, v}},
            {"mean_se", "<f4", {c, l, v}},
            {"mean_bias", "<f4", {c, l, v}},
            {"pixel_se", "<f4", {c, l}}};
}

void append_small(ArrayWriter& writer, const Btf& btf) {
    writer.append(std::span<const float>(btf.mean.f));
    writer.append(std::span<const float>(btf.mean.se));
    writer.append(std::span<const float>(btf.mean.bias));
    const std::vector<float> pixel_se(btf.pixel_se.begin(), btf.pixel_se.end());
    writer.append(std::span<const float>(pixel_se));
}

std::vector<ArraySection> factored_arrays(const BtfShape& shape) {
    std::vector<ArraySection> sections = small_arrays(shape);
    sections.push_back(
        {"facet_radiance",
         "<f2",
         {static_cast<size_t>(shape.n_channels), static_cast<size_t>(shape.n_lights), shape.n_facets}});
    sections.push_back({"view_maps",
                        "<u4",
                        {static_cast<size_t>(shape.n_views), static_cast<size_t>(shape.pixel_samples),
                         static_cast<size_t>(shape.pixels_y), static_cast<size_t>(shape.pixels_x)}});
    return sections;
}

ArraySection images_array(const BtfShape& shape) {
    return {"images",
            "<f2",
            {static_cast<size_t>(shape.n_views), static_cast<size_t>(shape.n_lights),
             static_cast<size_t>(shape.n_channels), static_cast<size_t>(shape.pixels_y),
             static_cast<size_t>(shape.pixels_x)}};
}

// [channel][light][view], as lists in lists.
ordered_json nested(const std::vector<float>& values, const BtfShape& shape) {
    ordered_json list = ordered_json::array();
    auto value = values.begin();
    for (int c = 0; c < shape.n_channels; ++c)
        for (int l = 0; l < shape.n_lights; ++l, value += shape.n_views)
            list[c].push_back(std::vector<float>(value, value + shape.n_views));
    return list;
}

// What an .npy file says behind its images: the head of the file of arrays, whose small arrays stand before
// it, for they can be longer than where provenance is looked for.
ordered_json last_line(const ordered_json& head, const Btf& btf) {
    ordered_json said{{"axes", {"view", "light", "channel", "row", "column"}},
                      {"mean_axes", {"channel", "light", "view"}},
                      {"mean", nested(btf.mean.f, btf.shape)},
                      {"mean_se", nested(btf.mean.se, btf.shape)},
                      {"mean_bias", nested(btf.mean.bias, btf.shape)}};
    for (int c = 0; c < btf.shape.n_channels; ++c) {
        const auto first = btf.pixel_se.begin() + static_cast<long>(c) * btf.shape.n_lights;
        said["pixel_se"].push_back(std::vector<float>(first, first + btf.shape.n_lights));
    }
    said.update(head);
    return said;
}

// Takes the images of one view after the other: [light][channel][row][column], halves.
using ImageSink = std::function<void(std::span<const uint16_t> images)>;

void write_npy_images(const std::string& path, const ordered_json& head, const BtfShape& shape,
                      const std::function<const Btf&(const ImageSink&)>& write) {
    write_npy_file(path, "'<f2'", images_array(shape).shape, [&](std::ostream& out) {
        return last_line(head, write([&](std::span<const uint16_t> images) {
                             out.write(reinterpret_cast<const char*>(images.data()),
                                       static_cast<std::streamsize>(images.size_bytes()));
                         }));
    });
}

void write_images(ordered_json head, const Btf& btf, ImageForm form, const std::string& path,
                  const Monitor& monitor) {
    const BtfShape& shape = btf.shape;
    const auto write_views = [&](const ImageSink& sink) -> const Btf& {
        std::vector<uint16_t> images(shape.images_size() / shape.n_views);
        for (int view = 0; view < shape.n_views; ++view) {
            monitor.report({static_cast<double>(view) / shape.n_views, "writing images", 0});
            expand_view(shape, btf.radiance, btf.view_maps, view, images);
            sink(images);
        }
        return btf;
    };
    head["form"] = "images";
    if (form == ImageForm::npy) return write_npy_images(path, head, shape, write_views);
    std::vector<ArraySection> sections = small_arrays(shape);
    sections.push_back(images_array(shape));
    write_array_file(path, std::move(head), std::move(sections), [&](ArrayWriter& writer) {
        append_small(writer, btf);
        write_views([&](std::span<const uint16_t> images) { writer.append(images); });
    });
}

int count(const JsonNode& node, size_t most) {
    return static_cast<int>(node.whole_number(1, most));
}

}  // namespace

const BtfPlan& pictures_of(const LoadedJob& job) {
    if (const auto* plan = std::get_if<LightFieldPlan>(&job.job.plan)) return *plan;
    return std::get<BtfPlan>(job.job.plan);
}

std::optional<ImageForm> image_form(const std::string& format) {
    if (format == "images") return ImageForm::arrays;
    if (format == "npy") return ImageForm::npy;
    return std::nullopt;
}

void write_factored_btf(const LoadedJob& job, const Btf& btf, const std::string& path) {
    write_array_file(path, head_of(job, btf), factored_arrays(btf.shape), [&](ArrayWriter& writer) {
        append_small(writer, btf);
        writer.append(std::span<const uint16_t>(btf.radiance));
        writer.append(std::span<const uint32_t>(btf.view_maps));
    });
}

void write_btf_images(const LoadedJob& job, const Btf& btf, ImageForm form, const std::string& path,
                      const Monitor& monitor) {
    write_images(head_of(job, btf), btf, form, path, monitor);
}

Btf write_glossy_images(const LoadedJob& job, GlossyBtf& glossy, const std::vector<OutputRequest>& files,
                        const GlossyPictures::OnView& on_view) {
    Btf btf;
    btf.shape = glossy.shape();
    btf.mean.channels = job.material.channels;
    btf.mean.provenance = glossy.report().settings;
    ordered_json head = head_of(job, btf);
    head["form"] = "images";
    std::vector<ArraySection> sections = small_arrays(btf.shape);
    sections.insert(sections.begin(), images_array(btf.shape));
    std::vector<ImageSink> sinks;
    // The pictures are made once: inside the last file, which is written inside the one before it.
    const std::function<const Btf&(size_t)> write_from = [&](size_t k) -> const Btf& {
        if (k == files.size())
            btf = glossy.pictures([&](int view, std::span<const uint16_t> images) {
                for (const ImageSink& sink : sinks) sink(images);
                on_view(view, images);
            });
        else if (const auto form = image_form(files[k].format); !form)
            write_from(k + 1);
        else if (form == ImageForm::npy)
            write_npy_images(files[k].path, head, btf.shape, [&](const ImageSink& sink) -> const Btf& {
                sinks.push_back(sink);
                return write_from(k + 1);
            });
        else
            write_array_file(files[k].path, head, sections, [&](ArrayWriter& writer) {
                sinks.push_back([&](std::span<const uint16_t> images) { writer.append(images); });
                append_small(writer, write_from(k + 1));
            });
        return btf;
    };
    write_from(0);
    return btf;
}

StoredBtf read_factored_btf(const std::string& path) {
    ArrayFile file(path);
    StoredBtf stored;
    stored.head = file.head().dump();
    const nlohmann::json checked = file.head();
    const JsonNode head(checked, path);
    if (head.at("format").text() != "gonio btf") head.at("format").refuse("must be \"gonio btf\"");
    head.at("version").whole_number(btf_format_version, btf_format_version);
    if (head.at("form").text() != "factored")
        head.at("form").refuse("must be \"factored\": images cannot be expanded");
    constexpr size_t most = 1 << 24;
    BtfShape& shape = stored.btf.shape;
    shape.n_lights = head.has("irradiance") ? 1 : static_cast<int>(head.at("incident_deg").array_size());
    shape.n_views = count(head.at("n_views"), most);
    shape.n_channels = static_cast<int>(head.at("channels").array_size());
    shape.pixels_x = count(head.at("pixels").element(0), most);
    shape.pixels_y = count(head.at("pixels").element(1), most);
    shape.pixel_samples = count(head.at("pixel_samples"), most);
    shape.n_facets = head.at("n_facets").whole_number(1, ~uint32_t{0});
    const std::vector<ArraySection> expected = factored_arrays(shape);
    const auto floats = [&](size_t i) {
        return file.read<float>(expected[i].name, "<f4", expected[i].shape);
    };
    stored.btf.mean.f = floats(0);
    stored.btf.mean.se = floats(1);
    stored.btf.mean.bias = floats(2);
    const std::vector<float> pixel_se = floats(3);
    stored.btf.pixel_se.assign(pixel_se.begin(), pixel_se.end());
    stored.btf.radiance = file.read<uint16_t>("facet_radiance", "<f2", expected[4].shape);
    stored.btf.view_maps = file.read<uint32_t>("view_maps", "<u4", expected[5].shape);
    for (const uint32_t facet : stored.btf.view_maps)
        if (facet >= shape.n_facets)
            throw Error(
                ErrorCode::invalid_input, path, std::to_string(facet),
                "a view map names a facet beyond the " + std::to_string(shape.n_facets) + " there are");
    return stored;
}

void expand_btf(const std::string& factored, ImageForm form, const std::string& images,
                const Monitor& monitor) {
    const StoredBtf stored = read_factored_btf(factored);
    write_images(ordered_json::parse(stored.head), stored.btf, form, images, monitor);
}

}  // namespace gonio
