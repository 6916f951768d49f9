// One client's socket with every limit applied to it. The library and the handlers read and write through it
// alone.
#pragma once
#include <atomic>
#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "server/http/limits.h"

namespace gonio::http {

// What tells the threads that sit on idle connections to let go.
struct Pressure {
    int drain_event;  // an eventfd, readable for good once the server drains
    const std::atomic<bool>& drain;
    const std::atomic<int>& waiting;  // connections that wait for a thread
};

class Connection : public BodyReader, public BodyWriter {
  public:
    // Owns the socket. `pressure` and `limits` must outlive it.
    Connection(int socket, const ServerLimits& limits, const Pressure& pressure)
        : socket_(socket), limits_(limits), pressure_(pressure) {}
    ~Connection() override;
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    // Waits for the next request. Nothing: the connection is over, with nobody to tell. Throws Failure for a
    // request that must be refused and the connection with it.
    std::optional<RequestHead> next_request();

    size_t read(char* buffer, size_t size) override;
    std::optional<uint64_t> length() const override;
    // Whether the next byte to read belongs to the next request.
    bool body_finished() const;

    bool write(std::string_view bytes) override;
    bool connected() const override;
    bool draining() const override { return pressure_.drain; }

    // Ends it so that an answer sent before the request was read to its end still arrives: closing with
    // unread data makes the kernel send a reset, which discards what the client has not read yet.
    void close_lingering();

    std::string peer_address() const;

  private:
    using Clock = std::chrono::steady_clock;
    enum class Wait { ready, timeout, drained };
    Wait wait_readable(std::chrono::milliseconds time, bool idle) const;
    bool receive(size_t most);  // false at the end of the stream
    void fill_body();

    int socket_;
    const ServerLimits& limits_;
    const Pressure& pressure_;
    std::string buffer_;   // received and not yet dropped
    size_t position_ = 0;  // of the first byte in it that nobody has taken
    RequestHead head_;
    ChunkDecoder chunks_;
    uint64_t body_read_ = 0;  // decoded
    Clock::time_point body_started_;
    bool continue_due_ = false;
    bool failed_ = false;  // nothing after it can be trusted to be a request
};

}  // namespace gonio::http
