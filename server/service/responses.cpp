#include "server/service/responses.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>

namespace gonio {

using http::Request;
using http::Response;
using nlohmann::ordered_json;

const std::string exceptions = "http://www.opengis.net/def/exceptions/ogcapi-processes-1/1.0/";

Response json_response(int status, const ordered_json& body) {
    Response response;
    response.status = status;
    response.set("Content-Type", "application/json");
    response.body = body.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    return response;
}

ordered_json link(const std::string& href, const std::string& rel, const std::string& type) {
    return {{"href", href}, {"rel", rel}, {"type", type}};
}

std::string time_text(int64_t ms) {
    const std::time_t seconds = static_cast<std::time_t>(ms / 1000);
    std::tm utc{};
    ::gmtime_r(&seconds, &utc);
    char text[40];
    const size_t n = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
    std::snprintf(text + n, sizeof text - n, ".%03dZ", static_cast<int>(ms % 1000));
    return text;
}

std::optional<int64_t> time_from(const std::string& text) {
    std::tm utc{};
    const char* rest = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &utc);
    if (!rest) return std::nullopt;
    double fraction = 0;
    if (*rest == '.') {
        const auto [end, error] = std::from_chars(rest, text.c_str() + text.size(), fraction);
        if (error != std::errc()) return std::nullopt;
        rest = end;
    }
    if (std::string_view(rest) != "Z") return std::nullopt;
    return 1000 * static_cast<int64_t>(::timegm(&utc)) + std::lround(1000 * fraction);
}

bool is_finished(const StoredJob& job) {
    return job.status != JobStatus::accepted && job.status != JobStatus::running;
}

namespace {

// By the progress so far; nothing before it says anything.
std::optional<int64_t> seconds_left(const StoredJob& job) {
    if (job.status != JobStatus::running || !job.started || job.progress < 3) return std::nullopt;
    const int64_t now = std::chrono::duration_cast<std::chrono::milliseconds>(
                            std::chrono::system_clock::now().time_since_epoch())
                            .count();
    const double elapsed = static_cast<double>(std::max<int64_t>(0, now - *job.started)) / 1000;
    return std::llround(elapsed * (100 - job.progress) / job.progress);
}

}  // namespace

ordered_json status_info(const StoredJob& job) {
    const std::string self = "/jobs/" + job.id;
    ordered_json info = {{"jobID", job.id},
                         {"processID", job.process},
                         {"type", "process"},
                         {"status", status_name(job.status)},
                         {"message", job.message},
                         {"progress", job.progress},
                         {"created", time_text(job.created)},
                         {"updated", time_text(job.updated)},
                         {"job_hash", job.job_hash}};
    if (job.started) info["started"] = time_text(*job.started);
    if (job.finished) info["finished"] = time_text(*job.finished);
    if (job.expires) info["expires"] = time_text(*job.expires);
    if (!job.owner.empty()) info["owner"] = job.owner;
    if (job.relative_error_ppb) info["relative_error"] = 1e-9 * static_cast<double>(*job.relative_error_ppb);
    if (const auto left = seconds_left(job)) info["seconds_left"] = *left;
    if (job.problem) info["problem"] = ordered_json::parse(*job.problem, nullptr, false);
    info["links"] = ordered_json::array({link(self, "self"), link(self + "/document", "describedby"),
                                         link(self + "/events", "monitor", "text/event-stream")});
    if (job.status == JobStatus::successful)
        info["links"].push_back(link(self + "/results", "http://www.opengis.net/def/rel/ogc/1.0/results"));
    return info;
}

std::string etag_of(const StoredJob& job) {
    return "W/\"" + std::to_string(job.version) + "\"";
}

Response status_response(int status, const StoredJob& job) {
    Response response = json_response(status, status_info(job));
    response.set("ETag", etag_of(job));
    response.set("Cache-Control", "no-cache");
    if (!is_finished(job)) response.set("Retry-After", "1");
    return response;
}

StoredJob job_of(Store& store, const Request& request, const std::string& id) {
    const std::optional<StoredJob> job = store.find(id);
    if (!job || job->owner != request.user)
        http::fail(404, "there is no job " + id, exceptions + "no-such-job");
    return *job;
}

int64_t whole_parameter(const Request& request, const std::string& name, int64_t least, int64_t most,
                        int64_t otherwise) {
    const std::string text = request.parameter(name);
    if (text.empty()) return otherwise;
    int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || value < least || value > most)
        throw Error(ErrorCode::invalid_input, "?" + name, text,
                    "must be a whole number from " + std::to_string(least) + " to " + std::to_string(most));
    return value;
}

}  // namespace gonio
