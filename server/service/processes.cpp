#include "server/service/processes.h"

#include <algorithm>

#include "server/job.h"
#include "server/json_node.h"

namespace gonio {

using nlohmann::json;
using nlohmann::ordered_json;

const std::vector<ServiceProcess>& service_processes() {
    static const std::vector<ServiceProcess> processes = {
        {"brdf",
         "BRDF of a height field",
         "Shadowing, masking and every order of diffuse scattering, each value with its standard error and "
         "bias.",
         {"surface", "material", "measure", "accuracy"},
         {"surface", "material", "measure"}},
        {"reference",
         "The same by path tracing",
         "An unbiased path tracer that shares no code with process brdf: slow, to judge it by.",
         {"surface", "material", "measure", "accuracy", "reference"},
         {"surface", "material", "measure", "reference"}}};
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
            {"links",
             ordered_json::array(
                 {{{"href", "/processes/" + process.id}, {"rel", "self"}, {"type", "application/json"}}})}};
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
        if (schema.at("properties").contains(name))
            input["schema"] = schema.at("properties").at(name);
        else
            input["schema"] = {{"type", "object"},
                               {"properties", {{"paths", {{"type", "integer"}, {"minimum", 1}}}}}};
    }
    description["outputs"]["table"] = {
        {"title", "values, standard errors and biases"},
        {"schema",
         {{"oneOf", ordered_json::array({{{"type", "string"}, {"contentMediaType", "text/csv"}},
                                         {{"type", "object"}, {"contentMediaType", "application/json"}},
                                         {{"type", "string"}, {"contentMediaType", "image/x-exr"}}})}}}};
    description["outputs"]["report"] = {
        {"title", "what was chosen, skipped, counted, and how long it took"},
        {"schema", {{"type", "object"}, {"contentMediaType", "application/json"}}}};
    return description;
}

std::string job_document(const ServiceProcess& process, const json& inputs) {
    const JsonNode node(inputs, "/inputs");
    node.allow_keys(process.inputs);
    for (const std::string& name : process.required) static_cast<void>(node.at(name));
    return inputs.dump();
}

}  // namespace gonio
