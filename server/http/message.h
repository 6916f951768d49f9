// Requests and responses as handlers see them. The library below (cpp-httplib) is not visible here: only
// guarded_server.cpp includes it.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace gonio::http {

// ASCII, as header names and media types compare.
bool equal_ignoring_case(std::string_view a, std::string_view b);
std::string_view trimmed(std::string_view text);  // of spaces and tabs
// The parts between `separator`s, trimmed; empty parts are left out.
std::vector<std::string_view> split_list(std::string_view text, char separator);

struct IgnoringCase {
    using is_transparent = void;
    bool operator()(std::string_view a, std::string_view b) const;
};
using Headers = std::multimap<std::string, std::string, IgnoringCase>;

// The body of a request, read as it arrives: nothing is ever buffered whole.
class BodyReader {
  public:
    virtual ~BodyReader() = default;
    // At most `size` bytes, 0 at the end. Throws Failure: 413 above the server's limit, 408 below its rate,
    // 400 for broken chunks or a connection that ended.
    virtual size_t read(char* buffer, size_t size) = 0;
    virtual std::optional<uint64_t> length() const = 0;  // what the client announced
};

// The body of a response that is made while it is sent.
class BodyWriter {
  public:
    virtual ~BodyWriter() = default;
    virtual bool write(std::string_view bytes) = 0;  // false: the client is gone or too slow
    virtual bool connected() const = 0;
    virtual bool draining() const = 0;  // the server wants to end: endless streams must, downloads need not
};

struct Request {
    std::string method;
    std::string target;                             // as sent, with the query
    std::vector<std::string> captures;              // what stood for each {} of the route, decoded
    std::multimap<std::string, std::string> query;  // decoded
    Headers headers;                                // values exactly as sent
    std::string remote_address;                     // of the socket; no header can change it
    std::string user;                               // what the gate said; empty without one
    BodyReader* body = nullptr;                     // valid while the handler runs

    std::string header(std::string_view name) const;  // the first one; "" if there is none
    // All of one name as one list, as RFC 9110 section 5.3 joins them; "" if there is none.
    std::string header_list(std::string_view name) const;
    std::string parameter(const std::string& name) const;  // of the query; "" if there is none
};

struct Response {
    int status = 200;
    Headers headers;
    std::string body;
    // Instead of `body`: called once, after the headers are sent; false breaks the connection off, so that
    // the client sees that something is missing.
    std::function<bool(BodyWriter&)> stream;
    // Of what `stream` writes, above 0. Without it the end of the connection is the end of the body.
    std::optional<uint64_t> stream_length;

    Response& set(const std::string& name, std::string value);  // replaces
};

// Throws Error or Failure to refuse.
using Handler = std::function<Response(Request&)>;

// What the handlers see in a status line and a problem document; "Unknown" for a code outside RFC 9110.
const char* status_title(int status);

}  // namespace gonio::http
