// What the service can compute, as OGC API - Processes 1.0 describes it.
#pragma once
#include "server/service/process.h"

namespace gonio {

const std::vector<ServiceProcess>& service_processes();
const ServiceProcess* find_process(const std::string& id);

nlohmann::ordered_json process_summary(const ServiceProcess& process);
nlohmann::ordered_json process_description(const ServiceProcess& process);

// The job document of a request's "inputs". Throws Error with pointers under "/inputs" for members that the
// process does not have or lacks.
std::string job_document(const ServiceProcess& process, const nlohmann::json& inputs);

// One file each.
ServiceProcess brdf_process();
ServiceProcess reference_process();
ServiceProcess statistics_process();

}  // namespace gonio
