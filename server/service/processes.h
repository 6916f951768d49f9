// What the service can compute: one entry a process. A new kind of job is one description here.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace gonio {

struct ServiceProcess {
    std::string id, title, description;
    std::vector<std::string> inputs;  // members of "inputs", which are members of the job document
    std::vector<std::string> required;
};

const std::vector<ServiceProcess>& service_processes();
const ServiceProcess* find_process(const std::string& id);

// Summary and full description as OGC API - Processes 1.0 has them.
nlohmann::ordered_json process_summary(const ServiceProcess& process);
nlohmann::ordered_json process_description(const ServiceProcess& process);

// The job document of a request's "inputs". Throws Error with pointers under "/inputs" for members that the
// process does not have or lacks.
std::string job_document(const ServiceProcess& process, const nlohmann::json& inputs);

}  // namespace gonio
