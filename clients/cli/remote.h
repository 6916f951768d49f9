// A gonio service, as a client sees it: server/API.md. Connections that break and answers that say "later"
// are tried again; a job is never called failed because it could not be asked for.
#pragma once
#include <memory>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>

#include "base/monitor.h"

namespace gonio {

class RemoteService {
  public:
    // url: "http://host:port" or "https://...". token_file: one line "TOKEN" or "NAME TOKEN"; empty: none.
    // Throws Error(usage) for anything else.
    RemoteService(const std::string& url, const std::string& token_file);
    ~RemoteService();

    // Throw Error(unreachable) when a minute of attempts got no answer, Error(invalid_input) with the field
    // for what the service refuses, Error(limit) for what is too large for it, Error(not_found).

    // Uploads what is not there yet; the SHA-256 by which a job names it.
    std::string upload(const std::string& path);
    // statusInfo of the accepted job.
    nlohmann::json submit(const std::string& process, const nlohmann::json& inputs);
    nlohmann::json status(const std::string& job);
    // The statusInfo with which it ended; progress as it goes. A cancelled monitor throws and leaves the job
    // running.
    nlohmann::json wait(const std::string& job, const Monitor& monitor);
    nlohmann::json cancel(const std::string& job);
    nlohmann::json list(int limit);
    // Whether a job that is done has this output in this format.
    bool has(const std::string& job, const std::string& output, const std::string& format);
    // Output "table" in "csv", ...: goes on where a download broke, and holds it against its SHA-256.
    void fetch(const std::string& job, const std::string& output, const std::string& format,
               std::ostream& to);

  private:
    struct Connection;
    std::unique_ptr<Connection> connection_;
};

}  // namespace gonio
