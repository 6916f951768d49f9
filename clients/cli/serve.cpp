// gonio serve: the HTTP service.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <csignal>
#include <iostream>
#include <memory>
#include <thread>

#include "clients/cli/commands.h"
#include "clients/cli/execute.h"
#include "server/http/bearer.h"
#include "server/service/api.h"
#include "server/service/engine.h"
#include "server/service/metrics.h"
#include "server/service/page.h"

namespace gonio {
namespace {

using namespace std::chrono_literals;

struct ServeOptions {
    std::string listen = "127.0.0.1:8080", admin_listen, data, token_file;
    ServiceLimits limits;
    std::string executor, shared_folder;
    ExecutorOptions shards;
};

struct Address {
    std::string host;
    int port;
};

Address parse_address(const std::string& flag, const std::string& text) {
    const size_t colon = text.rfind(':');
    int port = -1;
    if (colon != std::string::npos) std::from_chars(text.data() + colon + 1, text.data() + text.size(), port);
    if (port < 0 || port > 65535)
        throw Error(ErrorCode::usage, flag, text, "must be ADDRESS:PORT; port 0 lets the system choose");
    return {text.substr(0, colon), port};
}

// Metrics and health for the operator's eyes. No token guards them, so the address must be one that only the
// operator reaches.
void add_admin(http::GuardedServer& admin, const http::GuardedServer& server, Store& store, Metrics& metrics,
               const Api& api) {
    admin.route("GET", "/metrics", [&](http::Request&) {
        http::Response response;
        response.set("Content-Type", "text/plain; version=0.0.4; charset=utf-8");
        response.body = metrics.text(store, api.open_event_streams());
        return response;
    });
    add_health(admin, store, server);
}

// Blocked before any thread starts, so that only sigwait sees them.
sigset_t block_end_signals() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    return signals;
}

int serve(const ServeOptions& serve, const CommonOptions& common) {
    const Address address = parse_address("--listen", serve.listen);
    std::optional<http::BearerTokens> tokens;
    if (!serve.token_file.empty()) tokens = http::BearerTokens::read(serve.token_file);
    if (!tokens && !http::is_loopback(address.host))
        throw Error(ErrorCode::usage, "--listen", serve.listen,
                    "other machines can reach it: needs a --token-file");
    // glibc would keep freed memory in an arena for each of the many threads, and take blocks of up to 32 MiB
    // from them, where the small ones of requests keep the large ones of runs from ever being given back.
    ::mallopt(M_ARENA_MAX, 2);
    ::mallopt(M_MMAP_THRESHOLD, 1 << 18);
    const sigset_t signals = block_end_signals();
    Store store({serve.data});
    JobTimes times;
    Metrics metrics;
    http::ServerHooks hooks;
    hooks.gate = [&](const http::Request& request) -> std::string {
        if (!tokens || request.target == "/healthz" || request.target == "/readyz" ||
            is_page_request(request))
            return "";
        return tokens->demand(request);
    };
    hooks.log = [&](const http::Request& request, int status, std::chrono::microseconds took) {
        metrics.count_request(request, status, took);
    };
    hooks.report = [](const http::Request& request, const std::string& text) {
        std::cerr << "gonio: error: " << request.target << ": " << text << std::endl;
    };
    http::ServerLimits server_limits;
    server_limits.body_bytes = std::max(serve.limits.surface_bytes, serve.limits.document_bytes);
    server_limits.event_streams = serve.limits.event_streams;
    http::GuardedServer server(server_limits, hooks), admin;
    const Api api(store, server, serve.limits, times);
    add_page(server);
    EngineOptions options;
    options.run = common.run_options();
    options.limits = serve.limits;
    if (!serve.executor.empty()) {
        options.executor = make_executor(serve.executor, serve.shards);
        options.shared_folder = serve.shared_folder.empty() ? serve.data + "/shards" : serve.shared_folder;
        options.shard_command = {this_program(), serve.shards.threads, true};
    }
    options.on_end = [&](const std::string& process, const std::string& status, double seconds) {
        metrics.count_job(process, status, seconds);
    };
    std::optional<Engine> engine;
    engine.emplace(store, times, options);
    std::cout << "listening on http://" << address.host << ":" << server.listen(address.host, address.port)
              << std::endl;
    if (!serve.admin_listen.empty()) {
        add_admin(admin, server, store, metrics, api);
        const Address to = parse_address("--admin-listen", serve.admin_listen);
        std::cout << "admin on http://" << to.host << ":" << admin.listen(to.host, to.port) << std::endl;
    }
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
        "  gonio serve --data DIR --listen 0.0.0.0:8080 --token-file tokens --admin-listen 127.0.0.1:9090\n"
        "SIGTERM drains: downloads end, the running job keeps its checkpoints. server/API.md has the API.");
    const auto options = std::make_shared<ServeOptions>();
    command->add_option("--data", options->data, "Folder of jobs and results")->required();
    command->add_option("--listen", options->listen, "Address and port")->capture_default_str();
    command->add_option("--token-file", options->token_file, "Bearer tokens, one NAME TOKEN a line");
    command->add_option("--admin-listen", options->admin_listen,
                        "Address of /metrics, /healthz, /readyz; no token");
    command
        ->add_option("--executor", options->executor,
                     "Where shards are computed: local, slurm, or a file of command templates (default: in "
                     "this process)")
        ->group("Other machines");
    command
        ->add_option("--shared-folder", options->shared_folder,
                     "Folder that all machines see (default: DATA/shards)")
        ->group("Other machines");
    command->add_option("--shard-threads", options->shards.threads, "Threads of each shard")
        ->group("Other machines");
    ServiceLimits& limits = options->limits;
    const auto limit = [&](const char* flag, auto& value, const char* help) {
        command->add_option(flag, value, help)->capture_default_str()->group("Limits");
    };
    limit("--max-surface-bytes", limits.surface_bytes, "Of an upload");
    limit("--max-table-bytes", limits.table_bytes, "Of a table, as predicted");
    limit("--max-job-bytes", limits.memory_bytes, "Of memory for a job, as predicted");
    limit("--max-job-seconds", limits.job_seconds, "Of computing for a job: predicted before, stopped after");
    limit("--max-queue", limits.queued_jobs, "Jobs in the queue");
    limit("--max-jobs-per-token", limits.jobs_per_user, "Unfinished jobs of a token");
    limit("--store-quota-bytes", limits.stored_bytes,
          "Of what is kept: checkpoints go first, then results and surfaces that were not used for long");
    limit("--max-event-streams", limits.event_streams, "Open at once");
    add_run_options(*command, common);
    for (const char* of_one_run : {"--checkpoints", "--no-skip", "--dry-run", "--json", "--quiet"})
        command->remove_option(command->get_option(of_one_run));
    command->callback(
        [options, &common, &action] { action = [options, &common] { return serve(*options, common); }; });
}

}  // namespace gonio
