// From a request to an accepted job: checked by the parser of the command line, held against the limits,
// durable before it is answered.
#include <charconv>
#include <cmath>

#include "base/sha256.h"
#include "base/text.h"
#include "server/http/json_limits.h"
#include "server/json_node.h"
#include "server/service/api.h"
#include "server/service/processes.h"
#include "server/service/responses.h"

namespace gonio {
namespace {

using http::Request;
using http::Response;

constexpr int longest_wait_seconds = 30;

// Seconds of "Prefer: wait=N".
int wanted_wait(const Request& request) {
    const std::string prefer = request.header_list("Prefer");
    for (const std::string_view part : http::split_list(prefer, ',')) {
        if (!part.starts_with("wait=")) continue;
        int seconds = 0;
        std::from_chars(part.data() + 5, part.data() + part.size(), seconds);
        return std::clamp(seconds, 0, longest_wait_seconds);
    }
    return 0;
}

[[noreturn]] void refuse_later(const std::string& detail, double seconds) {
    http::Problem problem;
    problem.status = 429;
    problem.detail = detail;
    throw http::Failure(
        problem, {{"Retry-After", std::to_string(std::clamp<long long>(std::llround(seconds), 1, 3600))}});
}

// The coarsest targets tried, until the work fits.
std::string target_that_fits(const PreparedJob& job, double most_seconds) {
    for (double target = 2 * job.target; job.at_target && target > 0 && target <= 0.3; target *= 2)
        if (job.at_target(target).cpu_seconds <= most_seconds)
            return "; a target_relative_error of " + number_text(target) + " would fit";
    return "; a smaller surface or fewer directions would fit";
}

std::string gib(double bytes) {
    char text[40];
    std::snprintf(text, sizeof text, "%.3g GiB", bytes / (1 << 30));
    return text;
}

void check_prediction(const PreparedJob& job, const ServiceLimits& limits) {
    const Prediction& p = job.prediction;
    auto refuse = [](const std::string& pointer, const std::string& detail) {
        http::Problem problem;
        problem.status = 422;
        problem.detail = "the job is larger than this service takes";
        problem.code = "limit";
        problem.errors.push_back({pointer, detail});
        throw http::Failure(problem);
    };
    if (p.table_bytes > limits.table_bytes)
        refuse("/inputs/measure",
               "a table of " + gib(p.table_bytes) + ", at most " + gib(limits.table_bytes) + ": " +
                   number_text(std::floor(1000 * limits.table_bytes / p.table_bytes) / 10) +
                   " % of its values would fit");
    if (p.memory_bytes > limits.memory_bytes)
        refuse("/inputs/surface",
               "would need " + gib(p.memory_bytes) + " of memory, at most " + gib(limits.memory_bytes) +
                   ": resample or crop it to " +
                   number_text(std::floor(100 * std::sqrt(limits.memory_bytes / p.memory_bytes))) +
                   " % of its width and depth");
    if (p.cpu_seconds > limits.job_seconds)
        refuse("/inputs/accuracy", "would take about " + number_text(std::round(p.cpu_seconds)) +
                                       " s of computing, at most " + number_text(limits.job_seconds) + " s" +
                                       target_that_fits(job, limits.job_seconds));
}

std::string without(std::string text, const std::string& part) {
    for (size_t at; (at = text.find(part)) != std::string::npos;) text.erase(at, part.size());
    return text;
}

PreparedJob prepare(const ServiceProcess& process, const std::string& document, Objects& objects) {
    try {
        return process.prepare(nlohmann::json::parse(document), objects);
    } catch (const Error& error) {
        // Pointers of the job document are pointers under /inputs of the request; a file of the store is what
        // was uploaded, and its path is nobody's business.
        const bool is_file = error.field().find(objects.folder()) != std::string::npos;
        throw Error(error.code(), is_file || error.field().empty() ? "/inputs" : "/inputs" + error.field(),
                    error.value(), without(error.allowed(), objects.folder()));
    }
}

}  // namespace

void Api::refuse_while_draining() const {
    if (!server_.draining()) return;
    http::Problem problem;
    problem.status = 503;
    problem.detail = "the service is about to end";
    throw http::Failure(problem, {{"Retry-After", "10"}});
}

// Before anything is read or computed: who sends too much must not cost much.
void Api::check_quotas(const Request& request) {
    const StoreCounts counts = store_.counts();
    const double seconds = times_.mean_seconds();
    if (counts.all.queued >= limits_.queued_jobs)
        refuse_later("the queue is full: " + std::to_string(limits_.queued_jobs) + " jobs", seconds);
    const auto own = counts.by_owner.find(request.user);
    if (own != counts.by_owner.end() && own->second.queued + own->second.running >= limits_.jobs_per_user)
        refuse_later(
            "you have " + std::to_string(limits_.jobs_per_user) + " unfinished jobs, as many as are allowed",
            seconds);
}

Response Api::execute(Request& request) {
    refuse_while_draining();
    check_quotas(request);
    const ServiceProcess* process = find_process(request.captures[0]);
    if (!process)
        http::fail(404, "there is no process " + request.captures[0], exceptions + "no-such-process");
    const nlohmann::json body = http::read_json(request, limits_.document_bytes);
    const JsonNode root(body);
    root.allow_keys({"inputs", "outputs", "response"});
    NewJob job;
    job.process = process->id;
    job.owner = request.user;
    job.document = job_document(*process, root.at("inputs").raw());
    {
        // A large surface takes memory and seconds, and requests come on many threads.
        preparing_.acquire();
        const std::shared_ptr<void> done(nullptr, [this](void*) { preparing_.release(); });
        PreparedJob prepared = prepare(*process, job.document, store_.objects());
        job.job_hash = prepared.job_hash;
        job.runs_hash = prepared.runs_hash;
        job.surfaces = std::move(prepared.surfaces);
        check_prediction(prepared, limits_);
    }
    if (const std::string key = request.header("Idempotency-Key"); !key.empty()) {
        if (key.size() > 255) http::fail(400, "an Idempotency-Key has at most 255 characters");
        job.idempotency_key = key;
        job.request_hash = sha256_hex(process->id + "\n" + body.dump());
    }
    const Acceptance acceptance = store_.accept(job);
    if (acceptance.outcome == Acceptance::Outcome::key_conflict)
        http::fail(422, "this Idempotency-Key came with another request before");
    StoredJob stored = acceptance.job;
    const int seconds = wanted_wait(request);
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(seconds);
    uint64_t seen = store_.changes();
    while (!is_finished(stored) && std::chrono::steady_clock::now() < until && !server_.draining()) {
        seen = store_.wait_for_change(seen, std::chrono::milliseconds(200));
        stored = job_of(store_, request, stored.id);
    }
    Response response = status_response(201, stored);
    response.set("Location", "/jobs/" + stored.id);
    if (seconds > 0) response.set("Preference-Applied", "wait=" + std::to_string(seconds));
    return response;
}

}  // namespace gonio
