#include "server/service/page.h"

#include <algorithm>

#include "base/sha256.h"
#include "server/http/files.h"
#include "server/http/negotiate.h"
#include "server/service/page_files.h"

namespace gonio {
namespace {

using http::Request;
using http::Response;

constexpr const char* content_security_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src "
    "'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

const char* media_type(std::string_view name) {
    if (name.ends_with(".html")) return "text/html; charset=utf-8";
    if (name.ends_with(".css")) return "text/css; charset=utf-8";
    if (name.ends_with(".svg")) return "image/svg+xml";
    return "text/javascript; charset=utf-8";
}

Response page_file(const Request& request, const std::string& name) {
    const auto file = std::find_if(std::begin(page_files), std::end(page_files),
                                   [&](const PageFile& one) { return one.name == name; });
    if (file == std::end(page_files)) http::fail(404, "the page has no file " + name);
    Response response;
    const std::string etag = "\"" + sha256_hex(file->content) + "\"";
    response.set("ETag", etag);
    // Asked for again each time, so that a new program shows a new page.
    response.set("Cache-Control", "no-cache");
    response.set("Content-Security-Policy", content_security_policy);
    response.set("Referrer-Policy", "no-referrer");
    if (http::matches_etag(request.header_list("If-None-Match"), etag)) {
        response.status = 304;
        return response;
    }
    response.set("Content-Type", media_type(name));
    response.body = file->content;
    return response;
}

}  // namespace

bool is_page_request(const Request& request) {
    if (request.method != "GET" && request.method != "HEAD") return false;
    if (request.target.starts_with("/page/")) return true;
    static const http::Choice choices[] = {{"json", "application/json"}, {"html", "text/html"}};
    return request.target == "/" && http::negotiate(request.header_list("Accept"), "", choices) == 1;
}

Response to_page() {
    Response response;
    response.status = 303;
    response.set("Location", "/page/");
    response.set("Vary", "Accept");
    return response;
}

void add_page(http::GuardedServer& server) {
    server.route("GET", "/page/", [](Request& request) { return page_file(request, "index.html"); });
    server.route("GET", "/page/{}", [](Request& request) { return page_file(request, request.captures[0]); });
}

}  // namespace gonio
