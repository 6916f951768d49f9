#include "server/service/api.h"

#include <algorithm>
#include <charconv>
#include <ctime>

#include "base/sha256.h"
#include "server/http/files.h"
#include "server/http/json_limits.h"
#include "server/http/negotiate.h"
#include "server/job_hash.h"
#include "server/service/engine.h"
#include "server/service/page.h"
#include "server/service/processes.h"

namespace gonio {
namespace {

using http::Request;
using http::Response;
using nlohmann::json;
using nlohmann::ordered_json;

const std::string exceptions = "http://www.opengis.net/def/exceptions/ogcapi-processes-1/1.0/";

Response json_response(int status, const ordered_json& body) {
    Response response;
    response.status = status;
    response.set("Content-Type", "application/json");
    response.body = body.dump(2) + "\n";
    return response;
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

bool is_finished(const StoredJob& job) {
    return job.status != JobStatus::accepted && job.status != JobStatus::running;
}

ordered_json link(const std::string& href, const std::string& rel) {
    return {{"href", href}, {"rel", rel}, {"type", "application/json"}};
}

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
    info["links"] = ordered_json::array({link(self, "self")});
    if (job.status == JobStatus::successful)
        info["links"].push_back(link(self + "/results", "http://www.opengis.net/def/rel/ogc/1.0/results"));
    return info;
}

Response status_response(int status, const StoredJob& job) {
    Response response = json_response(status, status_info(job));
    response.set("ETag", "W/\"" + std::to_string(job.version) + "\"");
    if (!is_finished(job)) response.set("Retry-After", "1");
    return response;
}

// Seconds of "Prefer: wait=N", at most 30.
int wanted_wait(const Request& request) {
    const std::string prefer = request.header_list("Prefer");
    for (const std::string_view part : http::split_list(prefer, ',')) {
        if (!part.starts_with("wait=")) continue;
        int seconds = 0;
        std::from_chars(part.data() + 5, part.data() + part.size(), seconds);
        return std::clamp(seconds, 0, 30);
    }
    return 0;
}

StoredJob job_of(Store& store, const std::string& id) {
    const std::optional<StoredJob> job = store.find(id);
    if (!job) http::fail(404, "there is no job " + id, exceptions + "no-such-job");
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

constexpr const char* conformance[] = {"core", "ogc-process-description", "json", "job-list", "dismiss"};

}  // namespace

Api::Api(Store& store, http::GuardedServer& server, const ApiLimits& limits)
    : store_(store), limits_(limits), streams_(64) {
    add_documents(server);
    add_surfaces(server);
    add_jobs(server);
    add_results(server);
}

void Api::add_documents(http::GuardedServer& server) {
    server.route("GET", "/", [](Request& request) {
        if (is_page_request(request)) return to_page();
        return json_response(
            200, {{"title", "gonio"},
                  {"description", "virtual gonioreflectometer: height fields to BRDF tables"},
                  {"links", ordered_json::array(
                                {link("/", "self"),
                                 link("/conformance", "http://www.opengis.net/def/rel/ogc/1.0/conformance"),
                                 link("/processes", "http://www.opengis.net/def/rel/ogc/1.0/processes"),
                                 link("/jobs", "http://www.opengis.net/def/rel/ogc/1.0/job-list")})}});
    });
    server.route("GET", "/conformance", [](Request&) {
        ordered_json list = ordered_json::array();
        for (const char* name : conformance)
            list.push_back(std::string("http://www.opengis.net/spec/ogcapi-processes-1/1.0/conf/") + name);
        return json_response(200, {{"conformsTo", list}});
    });
    server.route("GET", "/processes", [](Request&) {
        ordered_json list = ordered_json::array();
        for (const ServiceProcess& process : service_processes()) list.push_back(process_summary(process));
        return json_response(
            200, {{"processes", list}, {"links", ordered_json::array({link("/processes", "self")})}});
    });
    server.route("GET", "/processes/{}", [](Request& request) {
        const ServiceProcess* process = find_process(request.captures[0]);
        if (!process)
            http::fail(404, "there is no process " + request.captures[0], exceptions + "no-such-process");
        return json_response(200, process_description(*process));
    });
    server.route("GET", "/healthz", [](Request&) { return json_response(200, {{"status", "alive"}}); });
    server.route("GET", "/readyz", [this](Request&) {
        const StoreCounts counts = store_.counts();
        return json_response(
            200, {{"status", "ready"}, {"queued", counts.all.queued}, {"running", counts.all.running}});
    });
}

void Api::add_surfaces(http::GuardedServer& server) {
    server.route("PUT", "/surfaces/{}", [this](Request& request) {
        const std::string& sha256 = request.captures[0];
        if (!is_sha256(sha256)) http::fail(400, "a surface is named by the SHA-256 of its bytes, in hex");
        const bool known = store_.has_surface(sha256);
        ObjectWriter writer = store_.objects().writer();
        http::copy_body(request, limits_.surface_bytes, [&](std::string_view bytes) { writer.write(bytes); });
        store_.put_surface(writer.finish(sha256));
        Response response = json_response(known ? 200 : 201, {{"sha256", sha256}});
        response.set("Location", "/surfaces/" + sha256);
        return response;
    });
    server.route("GET", "/surfaces/{}", [this](Request& request) {
        const std::string& sha256 = request.captures[0];
        if (!store_.has_surface(sha256)) http::fail(404, "there is no surface " + sha256);
        http::FileOffer offer;
        offer.sha256 = sha256;
        offer.immutable = true;
        return http::serve_file(request, store_.objects().path(sha256), offer);
    });
}

Response Api::execute(Request& request) {
    const ServiceProcess* process = find_process(request.captures[0]);
    if (!process)
        http::fail(404, "there is no process " + request.captures[0], exceptions + "no-such-process");
    const std::string text = http::read_text(request, limits_.document_bytes);
    const json body = parse_json_strictly(text, {limits_.document_bytes, http::most_json_depth});
    const JsonNode root(body);
    root.allow_keys({"inputs", "outputs", "response"});
    NewJob job;
    job.process = process->id;
    job.document = job_document(*process, root.at("inputs").raw());
    try {
        ServiceJob loaded = load_service_job(job.document, store_.objects());
        job.job_hash = loaded.loaded.hash;
        job.surfaces = std::move(loaded.surfaces);
    } catch (const Error& error) {
        // Pointers of the job document are pointers under /inputs of the request.
        throw Error(error.code(), "/inputs" + error.field(), error.value(), error.allowed());
    }
    if (store_.counts().all.queued >= limits_.queued_jobs && store_.results(job.job_hash).empty())
        throw http::Failure({429, "about:blank", "", "the queue is full", "", "", {}},
                            {{"Retry-After", "10"}});
    if (const std::string key = request.header("Idempotency-Key"); !key.empty()) {
        if (key.size() > 255) http::fail(400, "an Idempotency-Key has at most 255 characters");
        job.idempotency_key = key;
        job.request_hash = sha256_hex(process->id + "\n" + text);
    }
    const Acceptance acceptance = store_.accept(job);
    if (acceptance.outcome == Acceptance::Outcome::key_conflict)
        http::fail(422, "this Idempotency-Key came with another request before");
    StoredJob stored = acceptance.job;
    const int seconds = wanted_wait(request);
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(seconds);
    uint64_t seen = store_.changes();
    while (!is_finished(stored) && std::chrono::steady_clock::now() < until) {
        seen = store_.wait_for_change(seen, std::chrono::milliseconds(200));
        stored = job_of(store_, stored.id);
    }
    Response response = status_response(201, stored);
    response.set("Location", "/jobs/" + stored.id);
    if (seconds > 0) response.set("Preference-Applied", "wait=" + std::to_string(seconds));
    return response;
}

void Api::add_jobs(http::GuardedServer& server) {
    server.route("POST", "/processes/{}/execution", [this](Request& request) { return execute(request); });
    server.route("GET", "/jobs", [this](Request& request) {
        JobFilter filter;
        filter.limit = whole_parameter(request, "limit", 1, 10000, 10);
        if (const int64_t after = whole_parameter(request, "after", 0, INT64_MAX, 0)) filter.after = after;
        if (const std::string process = request.parameter("processID"); !process.empty())
            filter.process = process;
        const std::string statuses = request.parameter("status");
        for (const std::string_view status : http::split_list(statuses, ','))
            filter.statuses.push_back(status_named(status));
        const std::vector<StoredJob> jobs = store_.list(filter);
        ordered_json list = ordered_json::array(), links = ordered_json::array({link("/jobs", "self")});
        for (const StoredJob& job : jobs) list.push_back(status_info(job));
        if (static_cast<int64_t>(jobs.size()) == filter.limit)
            links.push_back(link("/jobs?limit=" + std::to_string(filter.limit) +
                                     "&after=" + std::to_string(jobs.back().sequence),
                                 "next"));
        return json_response(200, {{"jobs", list}, {"links", links}});
    });
    server.route("GET", "/jobs/{}", [this](Request& request) {
        const StoredJob job = job_of(store_, request.captures[0]);
        Response response = status_response(200, job);
        if (http::matches_etag(request.header_list("If-None-Match"),
                               "W/\"" + std::to_string(job.version) + "\"")) {
            response.status = 304;
            response.body.clear();
        }
        return response;
    });
    server.route("DELETE", "/jobs/{}", [this](Request& request) {
        const std::string& id = request.captures[0];
        static_cast<void>(job_of(store_, id));
        store_.dismiss(id);
        // A running computation stops within a second.
        for (int k = 0; k < 20; ++k) {
            if (is_finished(job_of(store_, id))) break;
            static_cast<void>(store_.wait_for_change(store_.changes(), std::chrono::milliseconds(100)));
        }
        return status_response(200, job_of(store_, id));
    });
    server.route("GET", "/jobs/{}/events", [this](Request& request) {
        const std::string id = request.captures[0];
        static_cast<void>(job_of(store_, id));
        return streams_.open(request, [this, id](const std::string& last_id, std::chrono::milliseconds wait) {
            http::EventBatch batch;
            const uint64_t seen = store_.changes();
            StoredJob job = job_of(store_, id);
            if (std::to_string(job.version) == last_id && !is_finished(job)) {
                static_cast<void>(store_.wait_for_change(seen, wait));
                job = job_of(store_, id);
            }
            batch.last = is_finished(job);
            if (std::to_string(job.version) != last_id)
                batch.events.push_back({std::to_string(job.version), std::string(status_name(job.status)),
                                        status_info(job).dump()});
            return batch;
        });
    });
}

void Api::add_results(http::GuardedServer& server) {
    auto successful = [this](const std::string& id) {
        const StoredJob job = job_of(store_, id);
        if (!is_finished(job))
            http::fail(404, "the job is " + std::string(status_name(job.status)),
                       exceptions + "result-not-ready");
        if (job.status == JobStatus::dismissed) http::fail(410, "the job was dismissed");
        if (job.status == JobStatus::failed) http::fail(422, job.message);
        if (job.expires) http::fail(410, "the results were removed for want of room");
        return job;
    };
    server.route("GET", "/jobs/{}/results", [this, successful](Request& request) {
        const StoredJob job = successful(request.captures[0]);
        ordered_json results;
        for (const ResultOutput& output : store_.results(job.job_hash)) {
            const std::string name = output.name.substr(0, output.name.find('.'));
            ordered_json& formats = results[name];
            if (formats.is_null()) formats = ordered_json::array();
            formats.push_back({{"href", "/jobs/" + job.id + "/results/" + name +
                                            "?f=" + output.name.substr(output.name.find('.') + 1)},
                               {"type", output.media_type},
                               {"sha256", output.sha256},
                               {"bytes", output.bytes}});
        }
        return json_response(200, results);
    });
    server.route("GET", "/jobs/{}/results/{}", [this, successful](Request& request) {
        const StoredJob job = successful(request.captures[0]);
        std::vector<ResultOutput> outputs;
        std::vector<http::Choice> choices;
        for (const ResultOutput& output : store_.results(job.job_hash)) {
            if (output.name.substr(0, output.name.find('.')) != request.captures[1]) continue;
            outputs.push_back(output);
            choices.push_back({output.name.substr(output.name.find('.') + 1), output.media_type});
        }
        if (outputs.empty()) http::fail(404, "the job has no output " + request.captures[1]);
        const std::optional<size_t> chosen =
            http::negotiate(request.header_list("Accept"), request.parameter("f"), choices);
        if (!chosen) throw http::Failure(http::not_acceptable(choices));
        const ResultOutput& output = outputs[*chosen];
        store_.touch_results(job.job_hash);
        http::FileOffer offer{output.media_type, output.sha256, output.name, true};
        Response response = http::serve_file(request, store_.objects().path(output.sha256), offer);
        response.set("Vary", "Accept");
        return response;
    });
}

}  // namespace gonio
