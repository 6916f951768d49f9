// The HTTP API: routes between the server and the store. OGC API - Processes 1.0 (core, json, job-list,
// dismiss) plus uploaded surfaces and events; server/API.md is its page.
#pragma once
#include <functional>
#include <semaphore>

#include "server/http/events.h"
#include "server/http/guarded_server.h"
#include "server/service/job_times.h"
#include "server/service/limits.h"
#include "server/store/store.h"

namespace gonio {

class Api {
  public:
    // Adds every route. All must outlive the server's last request.
    Api(Store& store, http::GuardedServer& server, const ServiceLimits& limits, const JobTimes& times);

    int open_event_streams() const { return streams_.count(); }

  private:
    void add_documents();  // api.cpp
    void add_surfaces();   // api_surfaces.cpp
    void add_jobs();       // api_jobs.cpp
    void add_results();    // api_results.cpp

    // api_execution.cpp
    http::Response execute(http::Request& request);
    void check_quotas(const http::Request& request);
    void refuse_while_draining() const;

    Store& store_;
    http::GuardedServer& server_;
    ServiceLimits limits_;
    const JobTimes& times_;
    http::EventStreams streams_;
    std::counting_semaphore<> preparing_{2};
};

// Whether the service can take work: nothing, or why not.
std::string why_not_ready(Store& store, const http::GuardedServer& server);
// Adds /healthz and /readyz, which the admin address has, too.
void add_health(http::GuardedServer& to, Store& store, const http::GuardedServer& server);

}  // namespace gonio
