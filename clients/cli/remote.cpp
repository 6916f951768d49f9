#include "clients/cli/remote.h"

#include <httplib.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "base/sha256.h"
#include "clients/cli/execute.h"

namespace gonio {

using nlohmann::json;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

constexpr auto patience = 60s;

std::string token_from(const std::string& path) {
    std::istringstream words(read_text(path));
    std::string token, last;
    while (words >> last) token = last;
    return token;
}

json parsed(const httplib::Response& response) {
    json body = json::parse(response.body, nullptr, false);
    return body.is_discarded() ? json::object() : body;
}

// What the service refuses becomes the Error that `gonio run` would have thrown here.
[[noreturn]] void refuse(const std::string& url, const httplib::Response& response) {
    const json problem = parsed(response);
    std::string field, detail = problem.value("detail", "HTTP status " + std::to_string(response.status));
    if (problem.contains("errors") && problem["errors"].is_array() && !problem["errors"].empty()) {
        const json& first = problem["errors"][0];
        field = first.value("pointer", "");
        detail = first.value("detail", detail);
        if (field.starts_with("/inputs")) field.erase(0, 7);
    }
    const std::string code = problem.value("code", "");
    ErrorCode kind = ErrorCode::invalid_input;
    if (response.status == 401) kind = ErrorCode::usage;
    if (response.status == 404) kind = ErrorCode::not_found;
    if (response.status == 413 || code == "limit") kind = ErrorCode::limit;
    if (code == "missing_unit") kind = ErrorCode::missing_unit;
    if (response.status >= 500) kind = ErrorCode::unreachable;
    throw Error(kind, field.empty() ? url : field, "", detail);
}

bool is_later(int status) {
    return status == 429 || status == 502 || status == 503;
}

// A little longer each time, never the same for two clients, and as long as the service says.
std::chrono::milliseconds delay_before(int attempt, const httplib::Result& result) {
    static thread_local std::mt19937 random(std::random_device{}());
    const double most = std::min(5000.0, 100 * std::pow(2.0, attempt));
    std::chrono::milliseconds delay(
        static_cast<int>(std::uniform_real_distribution(0.5 * most, most)(random)));
    if (result && result->has_header("Retry-After"))
        delay = std::max(
            delay, 1000ms * std::clamp(std::atoi(result->get_header_value("Retry-After").c_str()), 0, 60));
    return delay;
}

std::string random_key() {
    std::random_device device;
    char text[40];
    std::snprintf(text, sizeof text, "%08x%08x%08x%08x", device(), device(), device(), device());
    return text;
}

}  // namespace

struct RemoteService::Connection {
    std::string url;
    httplib::Client client;
    httplib::Headers headers;

    explicit Connection(const std::string& to) : url(to), client(to) {}

    // Until there is an answer that is not "later".
    template <class Send>
    httplib::Result ask(Send&& send) {
        const Clock::time_point end = Clock::now() + patience;
        for (int attempt = 0;; ++attempt) {
            httplib::Result result = send();
            if (result && !is_later(result->status)) return result;
            const auto delay = delay_before(attempt, result);
            if (Clock::now() + delay > end) {
                if (result) refuse(url, *result);
                throw Error(ErrorCode::unreachable, url, "",
                            "does not answer (" + httplib::to_string(result.error()) + ")");
            }
            std::this_thread::sleep_for(delay);
        }
    }

    json ask_json(const std::function<httplib::Result()>& send) {
        const httplib::Result result = ask(send);
        if (result->status >= 300) refuse(url, *result);
        return parsed(*result);
    }
};

RemoteService::RemoteService(const std::string& url, const std::string& token_file) {
    if (!url.starts_with("http://") && !url.starts_with("https://"))
        throw Error(ErrorCode::usage, "--server", url, "must begin with http:// or https://");
    connection_ = std::make_unique<Connection>(url.substr(0, url.find_last_not_of('/') + 1));
    httplib::Client& client = connection_->client;
    if (!client.is_valid()) throw Error(ErrorCode::usage, "--server", url, "is no address");
    client.set_keep_alive(true);
    client.set_tcp_nodelay(true);
    client.set_connection_timeout(10s);
    client.set_read_timeout(60s);
    if (!token_file.empty())
        connection_->headers.emplace("Authorization", "Bearer " + token_from(token_file));
}

RemoteService::~RemoteService() = default;

std::string RemoteService::upload(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in || std::filesystem::is_directory(path))
        throw Error(ErrorCode::not_found, path, "", "cannot be read");
    const auto size = static_cast<size_t>(std::filesystem::file_size(path));
    std::string piece(size_t{1} << 20, '\0');
    Sha256 sum;
    while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())), in.gcount() > 0)
        sum.update({piece.data(), static_cast<size_t>(in.gcount())});
    const std::string sha256 = sum.hex(), target = "/surfaces/" + sha256;
    Connection& c = *connection_;
    if (c.ask([&] { return c.client.Head(target, c.headers); })->status == 200) return sha256;
    const auto send_piece = [&](size_t offset, size_t length, httplib::DataSink& sink) {
        in.clear();
        in.seekg(static_cast<std::streamoff>(offset));
        const size_t n = std::min(length, piece.size());
        if (!in.read(piece.data(), static_cast<std::streamsize>(n))) return false;
        return sink.write(piece.data(), n);
    };
    c.ask_json([&] { return c.client.Put(target, c.headers, size, send_piece, "application/octet-stream"); });
    return sha256;
}

json RemoteService::submit(const std::string& process, const json& inputs) {
    Connection& c = *connection_;
    httplib::Headers headers = c.headers;
    headers.emplace("Idempotency-Key", random_key());  // a second attempt must not make a second job
    const std::string body = json{{"inputs", inputs}}.dump();
    return c.ask_json([&] {
        return c.client.Post("/processes/" + process + "/execution", headers, body, "application/json");
    });
}

json RemoteService::status(const std::string& job) {
    Connection& c = *connection_;
    return c.ask_json([&] { return c.client.Get("/jobs/" + job, c.headers); });
}

bool RemoteService::has(const std::string& job, const std::string& output, const std::string& format) {
    Connection& c = *connection_;
    const json results = c.ask_json([&] { return c.client.Get("/jobs/" + job + "/results", c.headers); });
    const json formats = results.value(output, json::array());
    return std::any_of(formats.begin(), formats.end(),
                       [&](const json& one) { return one.value("href", "").ends_with("?f=" + format); });
}

json RemoteService::wait(const std::string& job, const Monitor& monitor) {
    for (auto pause = 20ms;; pause = std::min(2 * pause, std::chrono::milliseconds(1000))) {
        const json info = status(job);
        const std::string state = info.value("status", "");
        if (state != "accepted" && state != "running") return info;
        monitor.report({0.01 * info.value("progress", 0),
                        state == "accepted" ? "in the queue" : info.value("message", ""),
                        info.value("relative_error", 0.0)});
        std::this_thread::sleep_for(pause);
    }
}

json RemoteService::cancel(const std::string& job) {
    Connection& c = *connection_;
    return c.ask_json([&] { return c.client.Delete("/jobs/" + job, c.headers); });
}

json RemoteService::list(int limit) {
    Connection& c = *connection_;
    return c.ask_json([&] { return c.client.Get("/jobs?limit=" + std::to_string(limit), c.headers); });
}

void RemoteService::fetch(const std::string& job, const std::string& output, const std::string& format,
                          std::ostream& to) {
    Connection& c = *connection_;
    const std::string target = "/jobs/" + job + "/results/" + output + "?f=" + format;
    std::string etag, body;
    Sha256 sum;
    size_t received = 0;
    int status = 0;
    const httplib::Result result = c.ask([&] {
        httplib::Headers headers = c.headers;
        if (received > 0) {
            headers.emplace("Range", "bytes=" + std::to_string(received) + "-");
            headers.emplace("If-Range", etag);
        }
        return c.client.Get(
            target, headers,
            [&](const httplib::Response& response) {
                status = response.status;
                body.clear();
                if (received == 0) etag = response.get_header_value("ETag");
                return received == 0 || status == 206;
            },
            [&](const char* data, size_t n) {
                if (status >= 300) {
                    body.append(data, n);
                    return body.size() < 65536;
                }
                sum.update({data, n});
                received += n;
                return static_cast<bool>(to.write(data, static_cast<std::streamsize>(n)));
            });
    });
    if (status >= 300) {
        httplib::Response problem = *result;
        problem.body = body;
        refuse(c.url, problem);
    }
    if (etag != "\"" + sum.hex() + "\"")
        throw Error(ErrorCode::io, c.url + target, "", "came with another SHA-256 than it was sent with");
}

}  // namespace gonio
