// Which handler answers which path.
#pragma once
#include <string>
#include <vector>

#include "server/http/message.h"

namespace gonio::http {

class Router {
  public:
    // See GuardedServer::route().
    void add(const std::string& method, const std::string& pattern, Handler handler);
    // The handler of request.method and request.target; fills request.captures. Throws Failure: 404, or 405
    // with Allow. Texts go before "{}", then what was added first.
    const Handler& find(Request& request) const;

  private:
    struct Route {
        std::string method;
        std::vector<std::string> segments;
        Handler handler;
    };
    std::vector<Route> routes_;
};

}  // namespace gonio::http
