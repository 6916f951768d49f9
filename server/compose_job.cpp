#include "server/compose_job.h"

#include "base/error.h"
#include "server/json_node.h"

namespace gonio {

std::string compose_job(const std::vector<JobEntry>& entries) {
    nlohmann::json document = nlohmann::json::object();
    for (const JobEntry& entry : entries) {
        nlohmann::json& place = document[nlohmann::json::json_pointer(entry.pointer)];
        if (!entry.is_json) {
            place = entry.value;
            continue;
        }
        try {
            place = parse_json_strictly(entry.value);
        } catch (const Error& error) {
            throw Error(error.code(), entry.pointer, entry.value, error.what());
        }
    }
    return document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace gonio
