// gonio serve: the HTTP service.
#include <CLI/CLI.hpp>
#include <charconv>
#include <csignal>
#include <iostream>
#include <memory>
#include <thread>

#include "clients/cli/commands.h"
#include "server/http/bearer.h"
#include "server/service/api.h"
#include "server/service/engine.h"
#include "server/service/page.h"

namespace gonio {
namespace {

using namespace std::chrono_literals;

struct ServeOptions {
    std::string listen = "127.0.0.1:8080", data, token_file;
};

std::pair<std::string, int> host_and_port(const std::string& text) {
    const size_t colon = text.rfind(':');
    int port = -1;
    if (colon != std::string::npos) std::from_chars(text.data() + colon + 1, text.data() + text.size(), port);
    if (port < 0 || port > 65535)
        throw Error(ErrorCode::usage, "--listen", text,
                    "must be ADDRESS:PORT; port 0 lets the system choose");
    return {text.substr(0, colon), port};
}

int serve(const ServeOptions& serve, const CommonOptions& common) {
    const auto [host, port] = host_and_port(serve.listen);
    std::optional<http::BearerTokens> tokens;
    if (!serve.token_file.empty()) tokens = http::BearerTokens::read(serve.token_file);
    if (!tokens && !http::is_loopback(host))
        throw Error(ErrorCode::usage, "--listen", serve.listen,
                    "other machines can reach it: needs a --token-file");
    Store store({serve.data});
    http::ServerHooks hooks;
    hooks.gate = [&](const http::Request& request) {
        if (tokens && request.target != "/healthz" && request.target != "/readyz" &&
            !is_page_request(request))
            static_cast<void>(tokens->demand(request));
    };
    hooks.report = [](const http::Request& request, const std::string& text) {
        std::cerr << "gonio: error: " << request.target << ": " << text << std::endl;
    };
    // Blocked before any thread starts, so that only sigwait sees them.
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    http::GuardedServer server({}, hooks);
    const Api api(store, server, {});
    add_page(server);
    std::optional<Engine> engine;
    engine.emplace(store, EngineOptions{common.threads, common.run_options().max_bytes});
    std::cout << "listening on http://" << host << ":" << server.listen(host, port) << std::endl;
    int signal = 0;
    sigwait(&signals, &signal);
    const bool complete = server.drain(20s);
    engine.reset();
    return complete ? 0 : 1;
}

}  // namespace

void add_serve(CLI::App& app, CommonOptions& common, Action& action) {
    CLI::App* command = app.add_subcommand("serve", "Serve jobs over HTTP");
    command->footer(
        "  gonio serve --data /var/lib/gonio                 on 127.0.0.1:8080\n"
        "  gonio serve --data DIR --listen 127.0.0.1:0       prints the port that it got\n"
        "  gonio serve --data DIR --listen 0.0.0.0:8080 --token-file tokens\n"
        "SIGTERM drains: downloads end, the running job keeps its checkpoints. server/API.md has the API.");
    const auto options = std::make_shared<ServeOptions>();
    command->add_option("--data", options->data, "Folder of jobs and results")->required();
    command->add_option("--listen", options->listen, "Address and port")->capture_default_str();
    command->add_option("--token-file", options->token_file, "Bearer tokens, one a line");
    add_run_options(*command, common);
    command->callback(
        [options, &common, &action] { action = [options, &common] { return serve(*options, common); }; });
}

}  // namespace gonio
