#include "server/service/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "server/job_hash.h"

namespace gonio {
namespace {

using namespace prometheus;

const Histogram::BucketBoundaries request_buckets = {0.001, 0.005, 0.02, 0.1, 0.5, 2, 10, 60};
const Histogram::BucketBoundaries job_buckets = {0.1, 0.5, 2, 10, 60, 300, 1800, 7200, 43200};

// The first segment: job ids and hashes would make a series each.
std::string route_of(const http::Request& request) {
    const std::string path = request.target.substr(0, request.target.find('?'));
    for (const char* known :
         {"/processes", "/jobs", "/surfaces", "/page", "/api", "/conformance", "/healthz", "/readyz"})
        if (path.starts_with(known)) return known;
    return path == "/" ? "/" : "other";
}

double resident_bytes() {
    double pages = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> pages >> resident;
    return resident * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

double cpu_seconds() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    auto seconds = [](const timeval& t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

struct Metrics::Families {
    Registry registry;
    Family<Counter>& requests = BuildCounter()
                                    .Name("gonio_http_requests_total")
                                    .Help("Requests by route, method and status.")
                                    .Register(registry);
    Histogram& request_seconds = BuildHistogram()
                                     .Name("gonio_http_request_duration_seconds")
                                     .Help("From the head of a request to the end of its response.")
                                     .Register(registry)
                                     .Add({}, request_buckets);
    Family<Counter>& jobs =
        BuildCounter().Name("gonio_jobs_total").Help("Computations that ended.").Register(registry);
    Family<Histogram>& job_seconds =
        BuildHistogram().Name("gonio_job_duration_seconds").Help("Computing, by process.").Register(registry);
    Family<Gauge>& unfinished =
        BuildGauge().Name("gonio_jobs_unfinished").Help("Jobs in the queue and running.").Register(registry);
    Gauge& queued = unfinished.Add({{"status", "accepted"}});
    Gauge& running = unfinished.Add({{"status", "running"}});
    Gauge& event_streams = gauge("gonio_event_streams", "Event streams that are open.");
    Gauge& free_bytes = gauge("gonio_data_free_bytes", "Free on the disk of the data folder.");
    Gauge& resident = gauge("process_resident_memory_bytes", "Resident memory.");
    Gauge& cpu = gauge("process_cpu_seconds_total", "User and system time.");
    Gauge& start = gauge("process_start_time_seconds", "Start of the process, since the epoch.");

    Gauge& gauge(const std::string& name, const std::string& help) {
        return BuildGauge().Name(name).Help(help).Register(registry).Add({});
    }
};

Metrics::Metrics() : families_(std::make_unique<Families>()) {
    BuildGauge()
        .Name("gonio_build_info")
        .Help("Which program this is.")
        .Register(families_->registry)
        .Add({{"version", program_version()}})
        .Set(1);
    families_->start.SetToCurrentTime();
}

Metrics::~Metrics() = default;

void Metrics::count_request(const http::Request& request, int status, std::chrono::microseconds took) {
    const bool is_http = status != 0;
    families_->requests
        .Add({{"route", is_http ? route_of(request) : "none"},
              {"method", is_http ? request.method : "none"},
              {"status", std::to_string(status)}})
        .Increment();
    families_->request_seconds.Observe(1e-6 * static_cast<double>(took.count()));
}

void Metrics::count_job(const std::string& process, const std::string& status, double seconds) {
    families_->jobs.Add({{"process", process}, {"status", status}}).Increment();
    families_->job_seconds.Add({{"process", process}}, job_buckets).Observe(seconds);
}

std::string Metrics::text(Store& store, int open_event_streams) {
    const StoreCounts counts = store.counts();
    families_->queued.Set(static_cast<double>(counts.all.queued));
    families_->running.Set(static_cast<double>(counts.all.running));
    families_->event_streams.Set(open_event_streams);
    std::error_code failure;
    const auto space = std::filesystem::space(store.folder(), failure);
    families_->free_bytes.Set(failure ? 0 : static_cast<double>(space.available));
    families_->resident.Set(resident_bytes());
    families_->cpu.Set(cpu_seconds());
    return TextSerializer().Serialize(families_->registry.Collect());
}

}  // namespace gonio
