#include "server/http/guarded_server.h"

#include <fcntl.h>
#include <httplib.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <ctime>
#include <deque>
#include <mutex>
#include <set>
#include <thread>

#include "base/error.h"
#include "server/http/connection.h"
#include "server/http/problem.h"
#include "server/http/router.h"

// This file leans on three protected or public members of one release: process_request(), svr_sock_ and
// Stream. Another release must be read before it is trusted; self_test() judges what was read.
static_assert(
    std::string_view(CPPHTTPLIB_VERSION) == "0.11.4",
    "guarded_server.cpp was written for Debian 12's cpp-httplib: read process_request() of this one");

namespace gonio::http {
namespace {

using std::chrono::milliseconds;

// What the library may see of a connection: a request line of ours, and nothing to read behind it. It has
// several ways to go wrong on headers and bodies (service by Range, percent-decoded values, unbounded
// chunks, unpacking); bytes that it never gets need no patch.
class LibraryStream : public httplib::Stream {
  public:
    LibraryStream(Connection& connection, const std::string& method)
        : connection_(connection), head_(method + " / HTTP/1.1\r\n\r\n") {}
    ssize_t read(char* out, size_t size) override {
        const size_t n = head_.copy(out, size, taken_);
        taken_ += n;
        return static_cast<ssize_t>(n);
    }
    ssize_t write(const char* bytes, size_t size) override {
        return connection_.write({bytes, size}) ? static_cast<ssize_t>(size) : -1;
    }
    bool is_readable() const override { return taken_ < head_.size(); }
    // Not a poll(): a full socket buffer only means that write() will wait, but the library would give up.
    bool is_writable() const override { return true; }
    void get_remote_ip_and_port(std::string&, int&) const override {}
    void get_local_ip_and_port(std::string&, int&) const override {}
    socket_t socket() const override { return 0; }  // the library refuses numbers above FD_SETSIZE

  private:
    Connection& connection_;
    std::string head_;
    size_t taken_ = 0;
};

// Hands what a handler streams to the library, no more than was announced.
class SinkWriter : public BodyWriter {
  public:
    SinkWriter(httplib::DataSink& sink, const Connection& connection, uint64_t most)
        : sink_(sink), connection_(connection), left_(most) {}
    bool write(std::string_view bytes) override {
        if (bytes.size() > left_) return false;
        left_ -= bytes.size();
        return bytes.empty() || sink_.write(bytes.data(), bytes.size());
    }
    bool connected() const override { return connection_.connected(); }
    bool draining() const override { return connection_.draining(); }
    uint64_t left() const { return left_; }

  private:
    httplib::DataSink& sink_;
    const Connection& connection_;
    uint64_t left_;
};

std::string http_date() {
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    ::gmtime_r(&now, &utc);
    char text[40];
    return {text, std::strftime(text, sizeof text, "%a, %d %b %Y %H:%M:%S GMT", &utc)};
}

// The library as a writer of responses. One a thread: its handlers have no way to be told whose turn it is.
class Library : public httplib::Server {
  public:
    explicit Library(const ServerLimits& limits) {
        svr_sock_ = 0;  // without a socket it believes to be shutting down and sends no streamed body
        set_keep_alive_max_count(static_cast<size_t>(limits.requests_per_connection));
        set_keep_alive_timeout(std::chrono::duration_cast<std::chrono::seconds>(limits.idle_time).count());
        set_pre_routing_handler([this](const httplib::Request&, httplib::Response& out) {
            fill(out);
            return HandlerResponse::Handled;
        });
        set_post_routing_handler([](const httplib::Request&, httplib::Response& out) {
            if (out.status == 204 || out.status == 304) out.headers.erase("Content-Length");
        });
    }

    // False: the client did not get all of it.
    bool send(Connection& connection, const std::string& method, Response& response, bool keep) {
        LibraryStream stream(connection, method);
        connection_ = &connection;
        response_ = &response;
        complete_ = true;
        bool closed = false;
        return process_request(stream, !keep, closed, nullptr) && complete_;
    }

  private:
    void fill(httplib::Response& out) {
        out.status = response_->status;
        out.set_header("Date", http_date());
        out.set_header("X-Content-Type-Options", "nosniff");
        for (const auto& [name, value] : response_->headers) {
            if (!equal_ignoring_case(name, "Content-Type")) out.set_header(name, value);
        }
        const auto type = response_->headers.find("Content-Type");
        const std::string media = type == response_->headers.end() ? "text/plain" : type->second;
        if (!response_->stream) {
            if (!response_->body.empty()) out.set_content(response_->body, media);
            return;
        }
        if (const auto length = response_->stream_length) {
            // Called once for the whole length: between two calls the library looks whether it should stop.
            out.set_content_provider(*length, media, [this, length](size_t, size_t, httplib::DataSink& sink) {
                SinkWriter writer(sink, *connection_, *length);
                return response_->stream(writer) && writer.left() == 0;
            });
        } else {
            out.set_content_provider(media, [this](size_t, httplib::DataSink& sink) {
                SinkWriter writer(sink, *connection_, UINT64_MAX);
                complete_ = response_->stream(writer);
                sink.done();
                return true;
            });
        }
    }

    Connection* connection_ = nullptr;
    Response* response_ = nullptr;
    bool complete_ = true;
};

[[noreturn]] void throw_system(const std::string& where, const std::string& what) {
    throw Error(ErrorCode::io, where, "", what + ": " + std::strerror(errno));
}

void switch_on(int socket, int level, int option, int value = 1) {
    ::setsockopt(socket, level, option, &value, sizeof value);
}

// Bound and listening, not blocking.
int listening_socket(const std::string& address, int port) {
    const std::string where = address + " port " + std::to_string(port);
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_PASSIVE;
    if (const int failure = ::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found)) {
        throw Error(ErrorCode::io, where, "", std::string("is no address: ") + ::gai_strerror(failure));
    }
    const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, ::freeaddrinfo);
    const int type = SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK;
    const int listener = ::socket(found->ai_family, type, 0);
    if (listener < 0) throw_system(where, "no socket");
    // Not SO_REUSEPORT, the library's default: a second server would bind the same port in silence and take
    // half of the connections.
    switch_on(listener, SOL_SOCKET, SO_REUSEADDR);
    // Connections that send nothing never reach a thread.
    switch_on(listener, IPPROTO_TCP, TCP_DEFER_ACCEPT, 5);
    constexpr int backlog = 1024;  // the library's 5 makes the sixth of a burst wait a second
    if (::bind(listener, found->ai_addr, found->ai_addrlen) != 0 || ::listen(listener, backlog) != 0) {
        const int failure = errno;
        ::close(listener);
        errno = failure;
        throw_system(where, "cannot be listened at");
    }
    return listener;
}

int port_of(int socket) {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(address).sin6_port
                                               : reinterpret_cast<sockaddr_in&>(address).sin_port);
}

std::string text_of(std::exception_ptr thrown) {
    try {
        std::rethrow_exception(thrown);
    } catch (const std::exception& failure) {
        return failure.what();
    } catch (...) {
        return "an exception of unknown type";
    }
}

// What waits, what is served and by whom. Threads are started with every signal blocked, so that SIGTERM
// reaches the program's own thread and never interrupts a handler.
class BlockedSignals {
  public:
    BlockedSignals() {
        sigset_t all;
        ::sigfillset(&all);
        ::pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    ~BlockedSignals() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

  private:
    sigset_t before_;
};

}  // namespace

struct GuardedServer::State {
    State(ServerLimits the_limits, ServerHooks the_hooks)
        : limits(the_limits), hooks(std::move(the_hooks)), drain_event(::eventfd(0, EFD_CLOEXEC)) {
        if (drain_event < 0) throw_system("eventfd", "no event");
    }
    ~State() { ::close(drain_event); }

    const ServerLimits limits;
    const ServerHooks hooks;
    Router router;

    std::atomic<bool> drain{false};
    std::atomic<int> waiting_count{0};
    const int drain_event;
    const Pressure pressure{drain_event, drain, waiting_count};

    std::mutex mutex;
    std::condition_variable changed;  // something below
    std::deque<int> waiting;          // accepted sockets
    std::set<int> served;             // sockets that threads work on
    bool accepting = false;
    bool cut = false;

    int listener = -1;
    std::thread acceptor;
    std::vector<std::thread> workers;

    Response respond(Request& request);
    void serve(Connection& connection, Library& library);
    void accept_connections();
    void accept_one();
    void work();
};

Response GuardedServer::State::respond(Request& request) {
    const std::string path = request.target.substr(0, request.target.find('?'));
    try {
        request.query = query_parameters(request.target);
        if (hooks.gate) request.user = hooks.gate(request);
        return router.find(request)(request);
    } catch (...) {
        Response response = problem_response(std::current_exception(), path);
        if (response.status >= 500 && hooks.report) hooks.report(request, text_of(std::current_exception()));
        return response;
    }
}

void GuardedServer::State::serve(Connection& connection, Library& library) {
    const std::string peer = connection.peer_address();
    for (int n = 1;; ++n) {
        Request request;
        Response response;
        std::optional<RequestHead> head;
        auto start = std::chrono::steady_clock::now();
        try {
            head = connection.next_request();
            if (!head) return;
            start = std::chrono::steady_clock::now();
            request.method = head->method;
            request.target = head->target;
            request.headers = std::move(head->headers);
            request.remote_address = peer;
            request.body = &connection;
            response = respond(request);
        } catch (const Failure&) {
            request.remote_address = peer;
            response = problem_response(std::current_exception(), "");
        }
        const bool endless = response.stream && !response.stream_length;
        const bool keep = head && head->keep_alive && n < limits.requests_per_connection && !drain &&
                          connection.body_finished() && !endless;
        const bool sent = library.send(connection, head ? head->method : "GET", response, keep);
        if (hooks.log) {
            hooks.log(request, response.status,
                      std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now() -
                                                                            start));
        }
        if (sent && keep) continue;
        if (!connection.body_finished()) connection.close_lingering();
        return;
    }
}

void GuardedServer::State::work() {
    Library library(limits);
    std::unique_lock lock(mutex);
    for (;;) {
        changed.wait(lock, [this] { return !waiting.empty() || (drain && !accepting); });
        if (waiting.empty()) return;
        const int socket = waiting.front();
        waiting.pop_front();
        --waiting_count;
        served.insert(socket);
        lock.unlock();
        {
            Connection connection(socket, limits, pressure);
            try {
                serve(connection, library);
            } catch (...) {  // out of memory, or a stream that threw: this connection alone ends
                if (hooks.report) hooks.report({}, text_of(std::current_exception()));
            }
            lock.lock();
            served.erase(socket);  // before it is closed and its number used again
        }
        changed.notify_all();
    }
}

void GuardedServer::State::accept_one() {
    const int socket = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket < 0) {
        // Out of descriptors or memory: the connection stays in the backlog until others end.
        if (errno != EAGAIN && errno != EINTR) std::this_thread::sleep_for(milliseconds(10));
        return;
    }
    // Headers and body are two writes: with Nagle's algorithm and a delayed ACK 40 ms apart.
    switch_on(socket, IPPROTO_TCP, TCP_NODELAY);
    const std::lock_guard lock(mutex);
    waiting.push_back(socket);
    ++waiting_count;
    changed.notify_all();
}

void GuardedServer::State::accept_connections() {
    pollfd sockets[2] = {{listener, POLLIN, 0}, {drain_event, POLLIN, 0}};
    while (!drain) {
        if (waiting_count >= limits.waiting) {
            std::this_thread::sleep_for(milliseconds(10));
        } else if (::poll(sockets, 2, -1) > 0 && sockets[0].revents) {
            accept_one();
        }
    }
    // What the kernel has accepted for us would be reset by close(): those clients were told "connected".
    while (::poll(sockets, 1, 0) > 0 && waiting_count < limits.waiting) accept_one();
    ::close(listener);
    const std::lock_guard lock(mutex);
    accepting = false;
    changed.notify_all();
}

namespace {

// What a connection with these bytes, and then no more, is answered.
template <class Serve>
std::string answer_to(const std::string& bytes, Serve&& serve) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
        throw_system("self-test", "no sockets");
    // Both directions fit into the buffers of the sockets, so that one thread can do all of it.
    if (::send(ends[0], bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0) throw_system("self-test", "no write");
    ::shutdown(ends[0], SHUT_WR);
    serve(ends[1]);  // closes it
    std::string answer;
    char block[4096];
    for (ssize_t n; (n = ::recv(ends[0], block, sizeof block, 0)) > 0;) answer.append(block, n);
    ::close(ends[0]);
    return answer;
}

int count(const std::string& text, const std::string& part) {
    int n = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
    return n;
}

}  // namespace

int GuardedServer::listen(const std::string& address, int port) {
    // The library in the process may be another than the one compiled for: ask it.
    const std::string text(1000, 'x');
    GuardedServer probe(state_->limits);
    probe.route("GET", "/text", [&](Request&) { return Response{200, {}, text, nullptr, {}}; });
    probe.route("POST", "/text", [&](Request&) { return Response{200, {}, text, nullptr, {}}; });
    probe.route("GET", "/stream", [&](Request&) {
        return Response{200, {}, "", [&](BodyWriter& out) { return out.write(text); }, text.size()};
    });
    const auto serve = [&probe](int socket) {
        Library library(probe.state_->limits);
        Connection connection(socket, probe.state_->limits, probe.state_->pressure);
        probe.state_->serve(connection, library);
    };
    const std::string rest = " HTTP/1.1\r\nHost: x\r\nRange: bytes=1-2\r\nAccept-Encoding: gzip\r\n\r\n";
    const std::string good =
        answer_to("GET /text" + rest + "HEAD /stream" + rest + "GET /stream" + rest, serve);
    const std::string smuggled = answer_to(
        "POST /text HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
        "GET /text" +
            rest,
        serve);
    if (count(good, "HTTP/1.1 200 ") != 3 || count(good, "Content-Length: 1000\r\n") != 3 ||
        count(good, "\r\n\r\n" + text) != 2 || count(smuggled, "HTTP/1.1 ") != 1 ||
        count(smuggled, "HTTP/1.1 400 ") != 1) {
        throw Error(ErrorCode::internal, "", "",
                    "the HTTP library answers otherwise than this server was written for; it will not start");
    }

    State& state = *state_;
    state.listener = listening_socket(address, port);
    const int bound = port_of(state.listener);
    const BlockedSignals blocked;
    state.accepting = true;
    for (int i = 0; i < state.limits.threads; ++i) state.workers.emplace_back([&state] { state.work(); });
    state.acceptor = std::thread([&state] { state.accept_connections(); });
    return bound;
}

bool GuardedServer::drain(milliseconds deadline) {
    State& state = *state_;
    state.drain = true;
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = ::write(state.drain_event, &one, sizeof one);
    std::unique_lock lock(state.mutex);
    const auto finished = [&state] {
        return !state.accepting && state.waiting.empty() && state.served.empty();
    };
    if (state.changed.wait_for(lock, deadline, finished)) return !state.cut;
    state.cut = true;
    for (const int socket : state.served) ::shutdown(socket, SHUT_RDWR);
    for (const int socket : state.waiting) ::close(socket);
    state.waiting.clear();
    state.waiting_count = 0;
    return false;
}

bool GuardedServer::draining() const {
    return state_->drain;
}

GuardedServer::GuardedServer(ServerLimits limits, ServerHooks hooks)
    : state_(std::make_unique<State>(limits, std::move(hooks))) {}

GuardedServer::~GuardedServer() {
    drain(milliseconds(0));
    if (state_->acceptor.joinable()) state_->acceptor.join();
    for (std::thread& worker : state_->workers) worker.join();
}

void GuardedServer::route(const std::string& method, const std::string& pattern, Handler handler) {
    state_->router.add(method, pattern, std::move(handler));
}

}  // namespace gonio::http
