#include "server/http/files.h"
#include "server/http/negotiate.h"
#include "server/service/api.h"
#include "server/service/responses.h"

namespace gonio {
namespace {

using http::Request;
using http::Response;
using nlohmann::ordered_json;

// Outputs are stored as "table.csv": the name of the output and that of the format.
std::pair<std::string, std::string> name_and_format(const ResultOutput& output) {
    const size_t dot = output.name.find('.');
    return {output.name.substr(0, dot), output.name.substr(dot + 1)};
}

// 500 for what lies with the service, 422 for what lies with the job.
int status_of_failure(const StoredJob& job) {
    const nlohmann::json problem = nlohmann::json::parse(job.problem.value_or(""), nullptr, false);
    const std::string code = problem.is_object() ? problem.value("code", "internal") : "internal";
    return code == code_name(ErrorCode::io) || code == code_name(ErrorCode::internal) ? 500 : 422;
}

// The job if it has results, else the error that the standard asks for.
StoredJob successful_job(Store& store, const Request& request) {
    const StoredJob job = job_of(store, request, request.captures[0]);
    if (!is_finished(job))
        http::fail(404, "the job is " + std::string(status_name(job.status)),
                   exceptions + "result-not-ready");
    if (job.status == JobStatus::dismissed) http::fail(410, "the job was dismissed");
    if (job.status == JobStatus::failed) http::fail(status_of_failure(job), job.message);
    if (job.expires)
        http::fail(410, "the results were removed for want of room; the same job again computes them");
    return job;
}

}  // namespace

void Api::add_results() {
    server_.route("GET", "/jobs/{}/results", [this](Request& request) {
        const StoredJob job = successful_job(store_, request);
        ordered_json results;
        for (const ResultOutput& output : store_.results(job.job_hash)) {
            const auto [name, format] = name_and_format(output);
            ordered_json& formats = results[name];
            if (formats.is_null()) formats = ordered_json::array();
            formats.push_back({{"href", "/jobs/" + job.id + "/results/" + name + "?f=" + format},
                               {"type", output.media_type},
                               {"sha256", output.sha256},
                               {"bytes", output.bytes}});
        }
        return json_response(200, results);
    });
    server_.route("GET", "/jobs/{}/results/{}", [this](Request& request) {
        const StoredJob job = successful_job(store_, request);
        std::vector<ResultOutput> outputs;
        std::vector<http::Choice> choices;
        for (const ResultOutput& output : store_.results(job.job_hash)) {
            const auto [name, format] = name_and_format(output);
            if (name != request.captures[1]) continue;
            outputs.push_back(output);
            choices.push_back({format, output.media_type});
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
