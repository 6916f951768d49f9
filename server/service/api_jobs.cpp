#include <algorithm>

#include "server/http/files.h"
#include "server/service/api.h"
#include "server/service/responses.h"

namespace gonio {
namespace {

using http::Request;
using http::Response;
using nlohmann::ordered_json;

// "T", "T1/T2", "../T2", "T1/..": an instant or an interval, ends included.
void read_interval(const std::string& text, JobFilter& filter) {
    const size_t slash = text.find('/');
    auto end_of = [&](const std::string& part) -> std::optional<int64_t> {
        if (part.empty() || part == "..") return std::nullopt;
        if (const auto time = time_from(part)) return time;
        throw Error(ErrorCode::invalid_input, "?datetime", text,
                    "must be a time (2026-01-31T12:00:00Z) or two of them with / between; .. is an open end");
    };
    filter.created_from = end_of(text.substr(0, slash));
    filter.created_to = slash == std::string::npos ? filter.created_from : end_of(text.substr(slash + 1));
}

JobFilter filter_of(const Request& request) {
    JobFilter filter;
    filter.owner = request.user;
    filter.limit = whole_parameter(request, "limit", 1, 10000, 10);
    if (const int64_t after = whole_parameter(request, "after", 0, INT64_MAX, 0)) filter.after = after;
    if (const std::string process = request.parameter("processID"); !process.empty())
        filter.process = process;
    const std::string statuses = request.parameter("status");
    for (const std::string_view status : http::split_list(statuses, ','))
        filter.statuses.push_back(status_named(status));
    if (const std::string interval = request.parameter("datetime"); !interval.empty())
        read_interval(interval, filter);
    constexpr int64_t year_s = 366 * 86400;
    if (!request.parameter("minDuration").empty())
        filter.min_duration_ms = 1000 * whole_parameter(request, "minDuration", 0, year_s, 0);
    if (!request.parameter("maxDuration").empty())
        filter.max_duration_ms = 1000 * whole_parameter(request, "maxDuration", 0, year_s, 0);
    if (const std::string type = request.parameter("type"); !type.empty() && type != "process")
        throw Error(ErrorCode::invalid_input, "?type", type, "must be process: there are no others");
    return filter;
}

// The same question from another job on.
std::string next_page(const Request& request, int64_t after) {
    std::string href = "/jobs?after=" + std::to_string(after);
    const size_t query = request.target.find('?');
    if (query == std::string::npos) return href;
    const std::string text = request.target.substr(query + 1);
    for (const std::string_view part : http::split_list(text, '&'))
        if (!part.starts_with("after=")) href += "&" + std::string(part);
    return href;
}

}  // namespace

void Api::add_jobs() {
    server_.route("POST", "/processes/{}/execution", [this](Request& request) { return execute(request); });
    server_.route("GET", "/jobs", [this](Request& request) {
        const JobFilter filter = filter_of(request);
        const std::vector<StoredJob> jobs = store_.list(filter);
        ordered_json list = ordered_json::array(), links = ordered_json::array({link("/jobs", "self")});
        for (const StoredJob& job : jobs) list.push_back(status_info(job));
        if (static_cast<int64_t>(jobs.size()) == filter.limit)
            links.push_back(link(next_page(request, jobs.back().sequence), "next"));
        return json_response(200, {{"jobs", list}, {"links", links}});
    });
    server_.route("GET", "/jobs/{}", [this](Request& request) {
        const StoredJob job = job_of(store_, request, request.captures[0]);
        Response response = status_response(200, job);
        if (http::matches_etag(request.header_list("If-None-Match"), etag_of(job))) {
            response.status = 304;
            response.body.clear();
        }
        return response;
    });
    server_.route("GET", "/jobs/{}/document", [this](Request& request) {
        const StoredJob job = job_of(store_, request, request.captures[0]);
        Response response;
        response.set("Content-Type", "application/json");
        response.body = *store_.document(job.id);
        return response;
    });
    server_.route("DELETE", "/jobs/{}", [this](Request& request) {
        const std::string& id = request.captures[0];
        static_cast<void>(job_of(store_, request, id));
        store_.dismiss(id);
        // A running computation stops within a second.
        for (int k = 0; k < 20; ++k) {
            if (is_finished(job_of(store_, request, id))) break;
            static_cast<void>(store_.wait_for_change(store_.changes(), std::chrono::milliseconds(100)));
        }
        return status_response(200, job_of(store_, request, id));
    });
    server_.route("GET", "/jobs/{}/events", [this](Request& request) {
        const std::string id = job_of(store_, request, request.captures[0]).id;
        return streams_.open(request, [this, id](const std::string& last_id, std::chrono::milliseconds wait) {
            http::EventBatch batch;
            const uint64_t seen = store_.changes();
            std::optional<StoredJob> job = store_.find(id);
            if (job && std::to_string(job->version) == last_id && !is_finished(*job)) {
                static_cast<void>(store_.wait_for_change(seen, wait));
                job = store_.find(id);
            }
            batch.last = !job || is_finished(*job);
            if (job && std::to_string(job->version) != last_id)
                batch.events.push_back({std::to_string(job->version), std::string(status_name(job->status)),
                                        status_info(*job).dump()});
            return batch;
        });
    });
}

}  // namespace gonio
