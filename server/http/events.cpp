#include "server/http/events.h"

#include <algorithm>
#include <thread>

#include "server/http/problem.h"

namespace gonio::http {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

// A drain and a client that left are noticed so fast.
constexpr milliseconds slice{100};

std::string without_breaks(std::string text) {
    std::erase_if(text, [](char c) { return c == '\r' || c == '\n' || c == '\0'; });
    return text;
}

bool goes_on(const BodyWriter& out) {
    return out.connected() && !out.draining();
}

void wait_until(Clock::time_point when, const BodyWriter& out) {
    while (Clock::now() < when && goes_on(out)) {
        std::this_thread::sleep_for(std::min<Clock::duration>(slice, when - Clock::now()));
    }
}

bool run_stream(const EventSource& source, std::string last_id, const EventTimes& times, BodyWriter& out) {
    if (!out.write("retry: " + std::to_string(times.retry.count()) + "\n\n")) return false;
    Clock::time_point written = Clock::now();
    while (goes_on(out)) {
        const EventBatch batch = source(last_id, slice);
        std::string text;
        for (const Event& event : batch.events) {
            text += format_event(event);
            if (!event.id.empty()) last_id = event.id;
        }
        if (text.empty() && Clock::now() - written >= times.heartbeat) text = ":\n\n";
        if (!text.empty()) {
            if (!out.write(text)) return false;
            written = Clock::now();
        }
        if (batch.last) return true;
        // After a batch alone: a source that has been silent is heard at once.
        if (!batch.events.empty()) wait_until(written + times.throttle, out);
    }
    return true;
}

}  // namespace

std::string format_event(const Event& event) {
    std::string text;
    if (!event.id.empty()) text += "id: " + without_breaks(event.id) + "\n";
    if (!event.name.empty()) text += "event: " + without_breaks(event.name) + "\n";
    // CR, LF and CR LF all end a line there, so a lone CR in the data would start a field.
    std::string data = event.data;
    for (size_t at; (at = data.find("\r\n")) != std::string::npos;) data.erase(at, 1);
    std::replace(data.begin(), data.end(), '\r', '\n');
    for (size_t start = 0; start <= data.size();) {
        const size_t end = std::min(data.find('\n', start), data.size());
        text += "data: " + data.substr(start, end - start) + "\n";
        start = end + 1;
    }
    return text + "\n";
}

Response EventStreams::open(const Request& request, EventSource source) {
    // Counted until the response is gone, whether or not it is ever sent.
    ++*count_;
    const std::shared_ptr<void> place(nullptr, [count = count_](void*) { --*count; });
    if (*count_ > most_) {
        Problem problem;
        problem.status = 503;
        problem.detail = "as many event streams as this server allows are open; ask for the status instead";
        throw Failure(problem, {{"Retry-After", "10"}});
    }
    Response response;
    response.set("Content-Type", "text/event-stream");
    response.set("Cache-Control", "no-store");
    response.set("X-Accel-Buffering", "no");  // nginx would hold events back until its buffer is full
    const std::string last_id = without_breaks(request.header("Last-Event-ID"));
    response.stream = [place, source = std::move(source), last_id, times = times_](BodyWriter& out) {
        return run_stream(source, last_id, times, out);
    };
    return response;
}

}  // namespace gonio::http
