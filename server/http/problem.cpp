#include "server/http/problem.h"

#include <nlohmann/json.hpp>

namespace gonio::http {
namespace {

Problem internal_problem() {
    Problem problem;
    problem.code = code_name(ErrorCode::internal);
    problem.detail = "The server failed; its log says why.";
    return problem;
}

}  // namespace

void fail(int status, const std::string& detail, const std::string& type) {
    Problem problem;
    problem.status = status;
    problem.type = type;
    problem.detail = detail;
    throw Failure(std::move(problem));
}

int http_status(ErrorCode code) {
    switch (code) {
        case ErrorCode::usage:
        case ErrorCode::invalid_input:
        case ErrorCode::missing_unit:
            return 400;
        case ErrorCode::not_found:
            return 404;
        case ErrorCode::limit:
            return 413;
        case ErrorCode::cancelled:
            return 409;
        case ErrorCode::io:
            return 503;
        case ErrorCode::unreachable:
        case ErrorCode::internal:
            return 500;
    }
    return 500;
}

Problem problem_of(const Error& error) {
    if (error.code() == ErrorCode::internal) return internal_problem();
    Problem problem;
    problem.status = http_status(error.code());
    problem.code = code_name(error.code());
    if (error.code() == ErrorCode::io) {
        problem.detail = "The server could not read or write its data; try again later.";
        return problem;
    }
    problem.detail = error.what();
    if (error.field().starts_with('/')) {
        // "/" alone is how JsonNode names the whole document, whose pointer is "".
        const std::string pointer = error.field() == "/" ? "" : error.field();
        const std::string value = error.value().empty() ? "" : error.value() + ": ";
        problem.errors.push_back({pointer, value + error.allowed()});
    }
    return problem;
}

Response problem_response(const Problem& problem) {
    nlohmann::ordered_json json;
    json["type"] = problem.type;
    json["title"] = problem.title.empty() ? status_title(problem.status) : problem.title;
    json["status"] = problem.status;
    if (!problem.detail.empty()) json["detail"] = problem.detail;
    if (!problem.instance.empty()) json["instance"] = problem.instance;
    if (!problem.code.empty()) json["code"] = problem.code;
    for (const Problem::At& at : problem.errors) {
        json["errors"].push_back({{"pointer", at.pointer}, {"detail", at.detail}});
    }
    Response response;
    response.status = problem.status;
    // A detail may quote bytes that are no UTF-8, on which dump() would throw in the middle of the error
    // path.
    response.body = json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    response.set("Content-Type", "application/problem+json");
    response.set("Cache-Control", "no-store");
    return response;
}

Response problem_response(std::exception_ptr thrown, const std::string& instance) {
    Problem problem;
    Headers headers;
    try {
        std::rethrow_exception(thrown);
    } catch (const Failure& failure) {
        problem = failure.problem;
        headers = failure.headers;
    } catch (const Error& error) {
        problem = problem_of(error);
    } catch (...) {
        problem = internal_problem();
    }
    if (problem.instance.empty()) problem.instance = instance;
    Response response = problem_response(problem);
    for (auto& [name, value] : headers) response.set(name, value);
    return response;
}

}  // namespace gonio::http
