// What an operator watches, as Prometheus text on the admin address. Names follow Prometheus' rules: base
// units, _total for counters.
#pragma once
#include <chrono>
#include <memory>
#include <string>

#include "server/http/guarded_server.h"
#include "server/service/job_times.h"
#include "server/store/store.h"

namespace gonio {

class Metrics {
  public:
    Metrics();
    ~Metrics();

    // From many threads.
    void count_request(const http::Request& request, int status, std::chrono::microseconds took);
    void count_job(const std::string& process, const std::string& status, double seconds);

    // The page. Gauges are looked up now.
    std::string text(Store& store, int open_event_streams);

  private:
    struct Families;
    std::unique_ptr<Families> families_;
};

}  // namespace gonio
