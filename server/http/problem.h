// Every error that leaves the server is an RFC 9457 problem document, and this is the one writer of them.
#pragma once
#include <exception>
#include <string>
#include <vector>

#include "base/error.h"
#include "server/http/message.h"

namespace gonio::http {

struct Problem {
    int status = 500;
    std::string type = "about:blank";  // a URI; about:blank says no more than the status
    std::string title;                 // filled with that of the status if empty
    std::string detail;
    std::string instance;  // which request; the server fills it with the path
    std::string code;      // of the Error, as `gonio run --json` names it
    struct At {
        std::string pointer;  // JSON pointer into the body of the request
        std::string detail;
    };
    std::vector<At> errors;
};

// Throw it to answer with this problem and these headers.
class Failure : public std::exception {
  public:
    explicit Failure(Problem what, Headers extra = {})
        : problem(std::move(what)), headers(std::move(extra)) {}
    const char* what() const noexcept override { return problem.detail.c_str(); }
    Problem problem;
    Headers headers;
};

// `type` is for instance one of OGC API - Processes.
[[noreturn]] void fail(int status, const std::string& detail, const std::string& type = "about:blank");

int http_status(ErrorCode code);
// Of an `internal` or `io` error neither text nor path leaves the server: they are for its log.
Problem problem_of(const Error& error);
// Whatever a handler threw: Failure as it is, Error as above, anything else 500 without its text.
Response problem_response(std::exception_ptr thrown, const std::string& instance);

Response problem_response(const Problem& problem);

}  // namespace gonio::http
