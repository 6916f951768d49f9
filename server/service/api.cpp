#include "server/service/api.h"

#include <algorithm>

#include "server/service/openapi.h"
#include "server/service/page.h"
#include "server/service/processes.h"
#include "server/service/responses.h"

namespace gonio {
namespace {

using http::Request;
using http::Response;
using nlohmann::ordered_json;

constexpr const char* conformance[] = {"core",   "ogc-process-description", "json", "oas30", "job-list",
                                       "dismiss"};

ordered_json landing() {
    return {{"title", "gonio"},
            {"description", "virtual gonioreflectometer: height fields to BRDF tables"},
            {"links",
             ordered_json::array({link("/", "self"), link("/api", "service-desc", openapi_media_type),
                                  link("/conformance", "http://www.opengis.net/def/rel/ogc/1.0/conformance"),
                                  link("/processes", "http://www.opengis.net/def/rel/ogc/1.0/processes"),
                                  link("/jobs", "http://www.opengis.net/def/rel/ogc/1.0/job-list")})}};
}

Response process_list(const Request& request) {
    const std::vector<ServiceProcess>& all = service_processes();
    const int64_t limit = whole_parameter(request, "limit", 1, 10000, 10),
                  first = whole_parameter(request, "offset", 0, 10000, 0),
                  end = std::min<int64_t>(first + limit, static_cast<int64_t>(all.size()));
    ordered_json list = ordered_json::array(), links = ordered_json::array({link("/processes", "self")});
    for (int64_t k = first; k < end; ++k) list.push_back(process_summary(all[static_cast<size_t>(k)]));
    if (end < static_cast<int64_t>(all.size()))
        links.push_back(
            link("/processes?limit=" + std::to_string(limit) + "&offset=" + std::to_string(end), "next"));
    return json_response(200, {{"processes", list}, {"links", links}});
}

}  // namespace

std::string why_not_ready(Store& store, const http::GuardedServer& server) {
    if (server.draining()) return "the service is about to end";
    return store.no_room();
}

void add_health(http::GuardedServer& to, Store& store, const http::GuardedServer& server) {
    to.route("GET", "/healthz", [](Request&) { return json_response(200, {{"status", "alive"}}); });
    to.route("GET", "/readyz", [&store, &server](Request&) {
        if (const std::string reason = why_not_ready(store, server); !reason.empty()) {
            Response response = json_response(503, {{"status", "not ready"}, {"reason", reason}});
            response.set("Retry-After", "10");
            return response;
        }
        const StoreCounts counts = store.counts();
        return json_response(
            200, {{"status", "ready"}, {"queued", counts.all.queued}, {"running", counts.all.running}});
    });
}

Api::Api(Store& store, http::GuardedServer& server, const ServiceLimits& limits, const JobTimes& times)
    : store_(store), server_(server), limits_(limits), times_(times), streams_(limits.event_streams) {
    add_documents();
    add_surfaces();
    add_jobs();
    add_results();
    add_health(server, store, server);
}

void Api::add_documents() {
    server_.route("GET", "/", [](Request& request) {
        return is_page_request(request) ? to_page() : json_response(200, landing());
    });
    server_.route("GET", "/api", [](Request&) {
        Response response;
        response.set("Content-Type", openapi_media_type);
        response.body = openapi_document();
        return response;
    });
    server_.route("GET", "/conformance", [](Request&) {
        ordered_json list = ordered_json::array();
        for (const char* name : conformance)
            list.push_back(std::string("http://www.opengis.net/spec/ogcapi-processes-1/1.0/conf/") + name);
        return json_response(200, {{"conformsTo", list}});
    });
    server_.route("GET", "/processes", process_list);
    server_.route("GET", "/processes/{}", [](Request& request) {
        const ServiceProcess* process = find_process(request.captures[0]);
        if (!process)
            http::fail(404, "there is no process " + request.captures[0], exceptions + "no-such-process");
        return json_response(200, process_description(*process));
    });
}

}  // namespace gonio
