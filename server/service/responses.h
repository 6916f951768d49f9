// What the routes answer with, as OGC API - Processes 1.0 has it.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "server/http/problem.h"
#include "server/store/store.h"

namespace gonio {

// Of the standard's types of problems: exceptions + "no-such-job".
extern const std::string exceptions;

http::Response json_response(int status, const nlohmann::ordered_json& body);
nlohmann::ordered_json link(const std::string& href, const std::string& rel,
                            const std::string& type = "application/json");

// RFC 3339, UTC, and back: "2026-01-31T12:00:00Z", with or without fractions of a second.
std::string time_text(int64_t ms);
std::optional<int64_t> time_from(const std::string& text);

bool is_finished(const StoredJob& job);
nlohmann::ordered_json status_info(const StoredJob& job);
// With ETag, and Retry-After while it is not finished.
http::Response status_response(int status, const StoredJob& job);
std::string etag_of(const StoredJob& job);

// The job, or 404: also for a job of another user, which must not be told from none.
StoredJob job_of(Store& store, const http::Request& request, const std::string& id);

// A whole number of the query. Throws Error(invalid_input) naming the parameter.
int64_t whole_parameter(const http::Request& request, const std::string& name, int64_t least, int64_t most,
                        int64_t otherwise);

}  // namespace gonio
