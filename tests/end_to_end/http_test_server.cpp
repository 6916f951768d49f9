// The same small service twice: on the library as its documentation shows it ("naive") and on ours
// ("guarded"). http_attacks_test.py attacks both, so that every attack is seen to work on one of them.
//   http_test_server naive|guarded PORT FOLDER
// Prints the port; serves the files of FOLDER at /files/NAME; SIGTERM ends it, with 0 if nothing was cut off.
#include <httplib.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <thread>

#include "base/error.h"
#include "base/sha256.h"
#include "server/http/bearer.h"
#include "server/http/events.h"
#include "server/http/files.h"
#include "server/http/guarded_server.h"
#include "server/http/json_limits.h"
#include "server/http/negotiate.h"
#include "server/http/problem.h"

namespace {

using namespace std::chrono_literals;

constexpr size_t most_body = 1 << 20;
constexpr int threads = 8;
const std::string text(1 << 20, 't');
const std::string blob(32 << 20, 'b');

std::string hex(const std::string& bytes) {
    std::string digits;
    for (const unsigned char c : bytes) {
        char two[3];
        std::snprintf(two, sizeof two, "%02x", c);
        digits += two;
    }
    return digits;
}

void announce(int port) {
    std::cout << port << std::endl;
}

void wait_for_sigterm() {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    int signal = 0;
    sigwait(&set, &signal);
}

int run_naive(int port) {
    using httplib::Request, httplib::Response;
    httplib::Server server;
    server.new_task_queue = [] { return new httplib::ThreadPool(threads); };
    server.set_payload_max_length(most_body);
    server.Get("/small", [](const Request&, Response& out) { out.set_content("ok", "text/plain"); });
    server.Get("/secret", [](const Request&, Response& out) { out.set_content("SMUGGLED", "text/plain"); });
    server.Get("/text", [](const Request&, Response& out) { out.set_content(text, "text/plain"); });
    server.Get("/blob", [](const Request&, Response& out) {
        out.set_content_provider(blob.size(), "application/octet-stream",
                                 [](size_t offset, size_t length, httplib::DataSink& sink) {
                                     // Beyond the end stands an L for what would be other memory.
                                     if (offset >= blob.size()) return sink.write("L", 1);
                                     const size_t there = std::min(length, blob.size() - offset);
                                     return sink.write(blob.data() + offset, std::min<size_t>(there, 65536));
                                 });
    });
    server.Get("/throw", [](const Request&, Response&) { throw std::runtime_error("secret /etc/path"); });
    server.Get("/header", [](const Request& in, Response& out) {
        out.set_content(hex(in.get_header_value("X-A")), "text/plain");
    });
    server.Get("/address", [](const Request& in, Response& out) {
        out.set_content(in.get_header_value("REMOTE_ADDR"), "text/plain");
    });
    server.Post("/upload", [](const Request& in, Response& out) {
        out.set_content(std::to_string(in.body.size()), "text/plain");
    });
    const int bound =
        port ? (server.bind_to_port("127.0.0.1", port) ? port : -1) : server.bind_to_any_port("127.0.0.1");
    if (bound < 0) return 2;
    std::thread stopper([&server] {
        wait_for_sigterm();
        server.stop();
    });
    announce(bound);
    server.listen_after_bind();
    stopper.join();
    return 0;
}

int run_guarded(int port, const std::string& folder) {
    using namespace gonio::http;
    ServerLimits limits;
    limits.threads = threads;
    limits.head_deadline = 1s;
    limits.body_bytes = most_body;
    limits.body_grace = 1s;
    limits.idle_time = 20s;
    EventStreams streams(2, {200ms, 50ms, 1000ms});
    ServerHooks hooks;
    hooks.report = [](const Request&, const std::string& what) { std::cerr << what << std::endl; };

    const auto plain = [](std::string body) {
        Response response;
        response.body = std::move(body);
        return response;
    };
    GuardedServer server(limits, hooks);
    server.route("GET", "/small", [&](Request&) { return plain("ok"); });
    server.route("GET", "/secret", [&](Request&) { return plain("SMUGGLED"); });
    server.route("GET", "/text", [&](Request&) { return plain(text); });
    server.route("GET", "/blob", [&](Request& in) { return serve_file(in, folder + "/blob", {}); });
    server.route("GET", "/throw", [](Request&) -> Response { throw std::runtime_error("secret /etc/path"); });
    server.route("GET", "/io", [](Request&) -> Response {
        throw gonio::Error(gonio::ErrorCode::io, "/etc/path", "", "secret");
    });
    server.route("GET", "/header", [&](Request& in) { return plain(hex(in.header("X-A"))); });
    server.route("GET", "/address", [&](Request& in) { return plain(in.remote_address); });
    server.route("POST", "/upload", [&](Request& in) {
        return plain(std::to_string(copy_body(in, most_body, [](std::string_view) {})));
    });
    server.route("POST", "/unread", [&](Request&) { return plain("not read"); });
    server.route("POST", "/json", [&](Request& in) { return plain(read_json(in, 1 << 16).dump()); });
    server.route("GET", "/slow", [&](Request&) {
        std::this_thread::sleep_for(1s);
        return plain("slow");
    });
    server.route("GET", "/stuck", [&](Request&) {
        std::this_thread::sleep_for(4s);
        return plain("stuck");
    });
    server.route("GET", "/inject", [&](Request&) { return plain("").set("X-Made", "a\r\nX-Forged: 1"); });
    server.route("GET", "/files/{}", [&](Request& in) {
        const std::string path = folder + "/" + in.captures.at(0);
        std::ostringstream content;
        if (std::filesystem::is_regular_file(path)) content << std::ifstream(path, std::ios::binary).rdbuf();
        return serve_file(in, path, {"text/csv", gonio::sha256_hex(content.str()), in.captures[0], true});
    });
    server.route("GET", "/choice", [&](Request& in) {
        const Choice choices[] = {{"json", "application/json"}, {"csv", "text/csv"}};
        const auto chosen = negotiate(in.header_list("Accept"), in.parameter("f"), choices);
        if (!chosen) throw Failure(not_acceptable(choices));
        return plain(choices[*chosen].name);
    });
    // Counts from 1 to 5, or for ever with ?endless=1.
    server.route("GET", "/events", [&](Request& in) {
        const bool endless = in.parameter("endless") == "1", silent = in.parameter("silent") == "1";
        return streams.open(
            in, [endless, silent](const std::string& last_id, std::chrono::milliseconds wait) {
                EventBatch batch;
                if (silent) std::this_thread::sleep_for(wait);
                if (silent) return batch;
                const int n = last_id.empty() ? 1 : std::atoi(last_id.c_str()) + 1;
                batch.events.push_back({std::to_string(n), "progress", "{\"n\":" + std::to_string(n) + "}"});
                batch.last = !endless && n >= 5;
                return batch;
            });
    });
    announce(server.listen("127.0.0.1", port));
    wait_for_sigterm();
    return server.drain(2s) ? 0 : 3;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 64;
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &set, nullptr);
    try {
        const int port = std::atoi(argv[2]);
        return std::string(argv[1]) == "naive" ? run_naive(port) : run_guarded(port, argv[3]);
    } catch (const std::exception& failure) {
        std::cerr << failure.what() << std::endl;
        return 2;
    }
}
