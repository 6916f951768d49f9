// The HTTP server under the service: routes, limits, draining. server/http/README.md says why it is built
// around Debian's cpp-httplib the way it is.
#pragma once
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "server/http/limits.h"
#include "server/http/message.h"

namespace gonio::http {

// What the service may hang into every request; each may be left empty. They are called from many threads.
struct ServerHooks {
    // Before the route is looked up: who asks (Request::user), or throws to refuse. The body is not read yet.
    std::function<std::string(const Request&)> gate;
    // After the answer. `status` is that of the response; 0 if the request was no HTTP.
    std::function<void(const Request&, int status, std::chrono::microseconds)> log;
    // The text of an error that the client must not see.
    std::function<void(const Request&, const std::string& text)> report;
};

class GuardedServer {
  public:
    explicit GuardedServer(ServerLimits limits = {}, ServerHooks hooks = {});
    ~GuardedServer();  // drains without patience

    // Before listen(). A pattern is a path whose segments are texts or "{}", which stands for any one segment
    // that is not empty: "/v1/jobs/{}/results". Not a regular expression, which std::regex would match by
    // recursion on text that the client chose. A GET route answers HEAD too.
    void route(const std::string& method, const std::string& pattern, Handler handler);

    // Starts to serve and returns; port 0 lets the system choose. Returns the port. Throws Error(io) if the
    // address cannot be had and Error(internal) if the library does not behave as this was written for.
    int listen(const std::string& address, int port);

    // Stops accepting, closes idle connections, lets requests and downloads in flight finish, then cuts what
    // is left at the deadline. Whether nothing had to be cut. Later calls find nothing left to do.
    bool drain(std::chrono::milliseconds deadline);
    bool draining() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace gonio::http
