#include "server/http/router.h"

#include <algorithm>
#include <set>

#include "server/http/framing.h"
#include "server/http/problem.h"

namespace gonio::http {
namespace {

bool matches(const std::vector<std::string>& pattern, const std::vector<std::string>& path) {
    return std::equal(pattern.begin(), pattern.end(), path.begin(), path.end(),
                      [](const std::string& wanted, const std::string& there) {
                          return wanted == "{}" ? !there.empty() : wanted == there;
                      });
}

}  // namespace

void Router::add(const std::string& method, const std::string& pattern, Handler handler) {
    Route route{method, path_segments(pattern), std::move(handler)};
    const auto open_segments = [](const Route& one) {
        return std::count(one.segments.begin(), one.segments.end(), "{}");
    };
    const auto behind = std::find_if(routes_.begin(), routes_.end(), [&](const Route& other) {
        return open_segments(other) > open_segments(route);
    });
    routes_.insert(behind, std::move(route));
}

const Handler& Router::find(Request& request) const {
    const std::vector<std::string> path = path_segments(request.target);
    std::set<std::string> allowed;
    for (const Route& route : routes_) {
        if (!matches(route.segments, path)) continue;
        const bool head_of_get = request.method == "HEAD" && route.method == "GET";
        if (route.method == request.method || head_of_get) {
            for (size_t i = 0; i < path.size(); ++i) {
                if (route.segments[i] == "{}") request.captures.push_back(path[i]);
            }
            return route.handler;
        }
        allowed.insert(route.method);
        if (route.method == "GET") allowed.insert("HEAD");
    }
    if (allowed.empty()) fail(404, "there is nothing at this address");
    std::string list;
    for (const std::string& method : allowed) list += (list.empty() ? "" : ", ") + method;
    Problem problem;
    problem.status = 405;
    problem.detail = "allowed here: " + list;
    throw Failure(problem, {{"Allow", list}});
}

}  // namespace gonio::http
