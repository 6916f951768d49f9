// What one client may take from the server.
#pragma once
#include <chrono>
#include <cstdint>

#include "server/http/framing.h"

namespace gonio::http {

struct ServerLimits {
    HeadLimits head;
    std::chrono::milliseconds head_deadline{10000};  // from the first byte of a head to its last
    uint64_t body_bytes = uint64_t{1} << 30;
    // A body, and every single write of a response, may take body_grace plus its bytes at this rate. A
    // timeout per read(), as the library has, lets one byte a second hold a thread for ever.
    uint64_t bytes_per_second = 16 << 10;
    std::chrono::milliseconds body_grace{20000};
    std::chrono::milliseconds write_grace{20000};
    int requests_per_connection = 1000;
    std::chrono::milliseconds idle_time{30000};  // between two requests; less while others wait for a thread
    int threads = 512;                           // a connection holds one while it is open; 1,000 take 15 MiB
    int waiting = 1024;      // accepted connections without a thread; more stay in the kernel's backlog
    int event_streams = 64;  // each holds a thread, so stay well below `threads`
};

}  // namespace gonio::http
