// What the service can compute, as OGC API - Processes 1.0 describes it.
#pragma once
#include "server/service/process.h"

namespace gonio {

struct Job;
struct MeasureKind;

const std::vector<ServiceProcess>& service_processes();
const ServiceProcess* find_process(const std::string& id);

nlohmann::ordered_json process_summary(const ServiceProcess& process);
nlohmann::ordered_json process_description(const ServiceProcess& process);

// The job document of a request's "inputs". Throws Error with pointers under "/inputs" for members that the
// process does not have or lacks.
std::string job_document(const ServiceProcess& process, const nlohmann::json& inputs);

// Of a kind of measurement that writes its files itself: `formats` are those of its own that the service
// offers, `product` says in words what is in them.
ServiceProcess measurement_process(const MeasureKind& kind, const std::string& title,
                                   const std::string& description, const std::string& product,
                                   std::vector<OutputFormat> formats);
// Throws Error for a job of another kind than its process does.
void require_kind(const Job& job, const std::string& process);

// One file each.
ServiceProcess brdf_process();
ServiceProcess reference_process();
ServiceProcess statistics_process();

}  // namespace gonio
