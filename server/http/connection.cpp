#include "server/http/connection.h"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "server/http/problem.h"

namespace gonio::http {
namespace {

using std::chrono::milliseconds;

constexpr size_t block = 64 << 10;

milliseconds since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - start);
}

milliseconds at_rate(uint64_t bytes, uint64_t per_second) {
    return milliseconds(static_cast<int64_t>(bytes * 1000 / std::max<uint64_t>(1, per_second)));
}

int poll_for(pollfd* sockets, nfds_t count, milliseconds time) {
    const auto bounded = std::clamp<int64_t>(time.count(), 0, 60000);
    const int ready = ::poll(sockets, count, static_cast<int>(bounded));
    return ready < 0 && errno == EINTR ? 0 : ready;
}

}  // namespace

Connection::~Connection() {
    ::close(socket_);
}

Connection::Wait Connection::wait_readable(milliseconds time, bool idle) const {
    pollfd sockets[2] = {{socket_, POLLIN, 0}, {pressure_.drain_event, POLLIN, 0}};
    if (poll_for(sockets, idle ? 2 : 1, time) <= 0) return Wait::timeout;
    // A request that has arrived is answered even when the server drains.
    return sockets[0].revents ? Wait::ready : Wait::drained;
}

bool Connection::receive(size_t most) {
    const size_t had = buffer_.size();
    buffer_.resize(had + most);
    ssize_t n;
    do n = ::recv(socket_, buffer_.data() + had, most, 0);
    while (n < 0 && errno == EINTR);
    buffer_.resize(had + static_cast<size_t>(std::max<ssize_t>(n, 0)));
    return n > 0;
}

std::optional<RequestHead> Connection::next_request() {
    buffer_.erase(0, position_);
    position_ = 0;
    body_read_ = 0;
    chunks_ = {};
    head_ = {};
    failed_ = true;  // until there is a proper head
    const Clock::time_point idle_since = Clock::now();
    std::optional<Clock::time_point> started;
    if (!buffer_.empty()) started = idle_since;
    for (;;) {
        while (buffer_.starts_with("\r\n")) buffer_.erase(0, 2);  // RFC 9112 section 2.2
        if (const auto end = find_head_end(buffer_, limits_.head)) {
            head_ = parse_head(std::string_view(buffer_).substr(0, *end), limits_.head);
            position_ = *end;
            break;
        }
        // Looked at in slices, because nothing wakes this thread when another connection starts to wait.
        constexpr milliseconds slice{100};
        const milliseconds left = started ? limits_.head_deadline - since(*started)
                                          : std::min(slice, limits_.idle_time - since(idle_since));
        if (left <= milliseconds(0)) {
            if (started) fail(408, "the headers did not arrive in time");
            return std::nullopt;
        }
        const Wait wait = wait_readable(left, !started);
        if (wait == Wait::drained) return std::nullopt;
        if (wait == Wait::timeout) {
            const bool others_wait = pressure_.waiting > 0 && !started && since(idle_since) >= slice;
            if (others_wait) return std::nullopt;
            continue;
        }
        if (!receive(8 << 10)) return std::nullopt;
        if (!started) started = Clock::now();
    }
    if (head_.content_length > limits_.body_bytes) fail(413, "the body is larger than the limit");
    failed_ = false;
    continue_due_ = head_.expects_continue;
    body_started_ = Clock::now();
    return head_;
}

std::optional<uint64_t> Connection::length() const {
    return head_.chunked ? std::nullopt : std::optional<uint64_t>(head_.content_length);
}

bool Connection::body_finished() const {
    if (failed_) return false;
    return head_.chunked ? chunks_.finished() : body_read_ == head_.content_length;
}

void Connection::fill_body() {
    if (continue_due_) {
        continue_due_ = false;
        write("HTTP/1.1 100 Continue\r\n\r\n");
    }
    const milliseconds allowed = limits_.body_grace + at_rate(body_read_, limits_.bytes_per_second);
    if (wait_readable(allowed - since(body_started_), false) != Wait::ready &&
        allowed <= since(body_started_)) {
        fail(408, "the body arrives too slowly");
    }
    buffer_.clear();
    position_ = 0;
    if (!receive(block)) fail(400, "the connection ended inside the body");
}

size_t Connection::read(char* out, size_t size) {
    if (failed_ || size == 0) return 0;
    try {
        while (!body_finished()) {
            if (position_ == buffer_.size()) fill_body();
            const std::string_view there = std::string_view(buffer_).substr(position_);
            size_t produced = 0;
            if (head_.chunked) {
                const ChunkDecoder::Step step = chunks_.decode(there, out, size);
                position_ += step.consumed;
                produced = step.produced;
            } else {
                produced = static_cast<size_t>(
                    std::min<uint64_t>({there.size(), size, head_.content_length - body_read_}));
                std::memcpy(out, there.data(), produced);
                position_ += produced;
            }
            body_read_ += produced;
            if (body_read_ > limits_.body_bytes) fail(413, "the body is larger than the limit");
            if (produced) return produced;
        }
    } catch (const Failure&) {
        failed_ = true;
        throw;
    }
    return 0;
}

bool Connection::write(std::string_view bytes) {
    const Clock::time_point start = Clock::now();
    const milliseconds allowed = limits_.write_grace + at_rate(bytes.size(), limits_.bytes_per_second);
    while (!bytes.empty()) {
        const ssize_t n = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n > 0) {
            bytes.remove_prefix(static_cast<size_t>(n));
            continue;
        }
        if (n < 0 && errno == EINTR) continue;
        if (n == 0 || (errno != EAGAIN && errno != EWOULDBLOCK)) return false;
        const milliseconds left = allowed - since(start);
        if (left <= milliseconds(0)) return false;
        pollfd out{socket_, POLLOUT, 0};
        poll_for(&out, 1, left);
    }
    return true;
}

bool Connection::connected() const {
    pollfd out{socket_, POLLRDHUP, 0};
    return poll_for(&out, 1, milliseconds(0)) == 0;
}

void Connection::close_lingering() {
    ::shutdown(socket_, SHUT_WR);
    const Clock::time_point start = Clock::now();
    pollfd in{socket_, POLLIN, 0};
    for (uint64_t dropped = 0; dropped < 8 << 20;) {
        // A client that drips would hold this thread for all of it, so less while others wait for one.
        const milliseconds left = milliseconds(pressure_.waiting > 0 ? 200 : 2000) - since(start);
        if (left <= milliseconds(0) || poll_for(&in, 1, left) <= 0) return;
        buffer_.clear();
        if (!receive(block)) return;
        dropped += buffer_.size();
    }
}

std::string Connection::peer_address() const {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    char host[64] = "";
    if (::getpeername(socket_, reinterpret_cast<sockaddr*>(&address), &size) == 0) {
        ::getnameinfo(reinterpret_cast<sockaddr*>(&address), size, host, sizeof host, nullptr, 0,
                      NI_NUMERICHOST);
    }
    return host;
}

}  // namespace gonio::http
