#include "server/service/processes.h"

#include <algorithm>

#include "server/job.h"
#include "server/json_node.h"
#include "server/measure_kind.h"

namespace gonio {

using nlohmann::json;
using nlohmann::ordered_json;

const std::vector<ServiceProcess>& service_processes() {
    static const std::vector<ServiceProcess> processes = {
        brdf_process(),
        reference_process(),
        statistics_process(),
        measurement_process(btf_kind(), "Bidirectional texture function of a height field",
                            "What a camera sees of every place of the base plane, for all lights and views.",
                            "radiance of every facet and which facet each pixel shows, or, of glossy facets, "
                            "all images; a picture; the means",
                            {{"btf", "application/octet-stream"},
                             {"images", "application/octet-stream"},
                             {"npy", "application/octet-stream"},
                             {"png", "image/png"},
                             {"csv", "text/csv"},
                             {"json", "application/json"}}),
        measurement_process(light_field_kind(), "Light field of a height field",
                            "Radiance over position and direction, or over two planes.",
                            "radiance of every facet and which facet each pixel shows, or, of glossy facets, "
                            "all images; a picture",
                            {{"btf", "application/octet-stream"},
                             {"images", "application/octet-stream"},
                             {"npy", "application/octet-stream"},
                             {"png", "image/png"}}),
        measurement_process(maps_kind(), "Light, shadow and sky on a height field",
                            "Direct, indirect and total light, shadow, masking and sky, one pixel a cell.",
                            "all layers, and a sheet of them",
                            {{"exr", "image/x-exr"},
                             {"png", "image/png"},
                             {"arrays", "application/octet-stream"},
                             {"npy", "application/octet-stream"},
                             {"json", "application/json"}}),
        measurement_process(
            relight_kind(), "A height field under an environment",
            "Radiance under light from all around: images, facets, and means over the surface.",
            "the means with their errors, images, and the radiance of every facet",
            {{"csv", "text/csv"},
             {"json", "application/json"},
             {"exr", "image/x-exr"},
             {"png", "image/png"},
             {"arrays", "application/octet-stream"},
             {"npy", "application/octet-stream"}}),
    };
    return processes;
}

const ServiceProcess* find_process(const std::string& id) {
    for (const ServiceProcess& process : service_processes())
        if (process.id == id) return &process;
    return nullptr;
}

ordered_json process_summary(const ServiceProcess& process) {
    return {{"id", process.id},
            {"version", "1.0.0"},
            {"title", process.title},
            {"description", process.description},
            {"jobControlOptions", {"async-execute", "dismiss"}},
            {"outputTransmission", {"reference"}},
            {"links", ordered_json::array({{{"href", "/processes/" + process.id},
                                            {"rel", "self"},
                                            {"type", "application/json"},
                                            {"title", "description"}},
                                           {{"href", "/processes/" + process.id + "/execution"},
                                            {"rel", "http://www.opengis.net/def/rel/ogc/1.0/execute"},
                                            {"title", "execution"}}})}};
}

ordered_json process_description(const ServiceProcess& process) {
    ordered_json description = process_summary(process);
    const json schema = json::parse(job_schema());
    for (const std::string& name : process.inputs) {
        const bool needed = std::count(process.required.begin(), process.required.end(), name) > 0;
        ordered_json& input = description["inputs"][name];
        input["title"] = name;
        input["minOccurs"] = needed ? 1 : 0;
        input["maxOccurs"] = 1;
        input["schema"] = process.own_schemas.contains(name) ? process.own_schemas.at(name)
                                                             : schema.at("properties").at(name);
    }
    for (const ProcessOutput& output : process.outputs) {
        ordered_json formats = ordered_json::array();
        for (const OutputFormat& format : output.formats) {
            const bool is_json = std::string(format.media_type) == "application/json";
            formats.push_back(
                {{"type", is_json ? "object" : "string"}, {"contentMediaType", format.media_type}});
        }
        description["outputs"][output.name] = {{"title", output.title}, {"schema", {{"oneOf", formats}}}};
    }
    return description;
}

std::string job_document(const ServiceProcess& process, const json& inputs) {
    const JsonNode node(inputs, "/inputs");
    node.allow_keys(process.inputs);
    for (const std::string& name : process.required) static_cast<void>(node.at(name));
    return inputs.dump();
}

}  // namespace gonio
