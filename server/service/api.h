// The HTTP API: routes between the server and the store. OGC API - Processes 1.0 (core, json, job-list,
// dismiss) plus uploaded surfaces and events; server/API.md is its page.
#pragma once
#include "server/http/events.h"
#include "server/http/guarded_server.h"
#include "server/store/store.h"

namespace gonio {

struct ApiLimits {
    uint64_t document_bytes = 16 << 20;
    uint64_t surface_bytes = uint64_t{1} << 30;
    int64_t queued_jobs = 1000;
};

class Api {
  public:
    // Adds every route. All three must outlive the server's last request.
    Api(Store& store, http::GuardedServer& server, const ApiLimits& limits);

  private:
    void add_documents(http::GuardedServer& server);
    void add_surfaces(http::GuardedServer& server);
    void add_jobs(http::GuardedServer& server);
    void add_results(http::GuardedServer& server);
    http::Response execute(http::Request& request);

    Store& store_;
    ApiLimits limits_;
    http::EventStreams streams_;
};

}  // namespace gonio
