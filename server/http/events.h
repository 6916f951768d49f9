// Server-sent events (the EventSource of browsers): progress as it happens.
#pragma once
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/http/message.h"

namespace gonio::http {

struct Event {
    std::string id;    // what the client sends back as Last-Event-ID; "" for none
    std::string name;  // "" for "message"
    std::string data;  // may have several lines
};

// As it goes over the wire. Line breaks, which would forge fields, are dropped from id and name.
std::string format_event(const Event& event);

struct EventBatch {
    std::vector<Event> events;
    bool last = false;  // the stream ends after them
};

// What happened after the event `last_id` ("" for: from now or from the start, as the source likes). Waits at
// most `wait` for something to happen; an empty batch is fine.
using EventSource = std::function<EventBatch(const std::string& last_id, std::chrono::milliseconds wait)>;

struct EventTimes {
    std::chrono::milliseconds heartbeat{15000};  // a comment after so much silence, for proxies
    std::chrono::milliseconds throttle{500};     // least time between two batches
    std::chrono::milliseconds retry{2000};       // when the client should come back
};

// The streams of one server, which hold a thread each.
class EventStreams {
  public:
    explicit EventStreams(int most, EventTimes times = {}) : most_(most), times_(times) {}

    // Starts at the client's Last-Event-ID. Ends with the source, the client or the server's drain. Throws
    // Failure(503) with Retry-After while `most` streams are open.
    Response open(const Request& request, EventSource source);
    int count() const { return *count_; }

  private:
    int most_;
    EventTimes times_;
    std::shared_ptr<std::atomic<int>> count_ = std::make_shared<std::atomic<int>>(0);
};

}  // namespace gonio::http
