// Where one request ends and the next begins: pure functions over bytes, stricter than the library's own.
// Whatever two programs on the way could read in two manners is refused, for that is how requests are
// smuggled.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace gonio::http {

struct HeadLimits {
    size_t header_bytes = 32 << 10;  // of the whole head
    size_t header_count = 100;
    size_t target_bytes = 8000;  // the library refuses a request line above 8192
};

struct RequestHead {
    std::string method;
    std::string target;  // starts with "/"; visible ASCII
    Headers headers;
    uint64_t content_length = 0;
    bool chunked = false;
    bool keep_alive = true;
    bool expects_continue = false;

    bool has_body() const { return chunked || content_length > 0; }
};

// Position behind the blank line that ends the head, nothing if more bytes are needed. Throws Failure: 431
// when the limit is reached first, 400 for a line feed that no carriage return precedes.
std::optional<size_t> find_head_end(std::string_view bytes, const HeadLimits& limits);

// `head` ends with the blank line. Throws Failure (400, 411, 414, 415, 417, 431, 501, 505).
RequestHead parse_head(std::string_view head, const HeadLimits& limits);

// "%41" -> "A". Throws Failure(400) for a broken escape or an escaped control character.
std::string percent_decoded(std::string_view text);
// The segments of a target's path, decoded one by one, so that "a%2Fb" stays one segment.
std::vector<std::string> path_segments(std::string_view target);
// "+" is a space in a query.
std::multimap<std::string, std::string> query_parameters(std::string_view target);

// Takes the chunked coding (RFC 9112 section 7.1) off a body that arrives in pieces.
class ChunkDecoder {
  public:
    struct Step {
        size_t consumed = 0;
        size_t produced = 0;
    };
    // Writes what it can of `in` to `out`. Throws Failure(400) for anything but digits where a size belongs,
    // for sizes of more than 15 digits and for extensions or trailers of more than 8 KiB together.
    Step decode(std::string_view in, char* out, size_t out_size);
    bool finished() const { return state_ == State::finished; }

  private:
    enum class State {
        size,
        extension,
        size_lf,
        data,
        data_cr,
        data_lf,
        trailer_start,
        trailer,
        trailer_lf,
        end_lf,
        finished
    };
    void step(char c);
    State state_ = State::size;
    uint64_t left_ = 0;  // bytes of this chunk to come
    int digits_ = 0;
    size_t extra_ = 0;  // bytes of extensions and trailers so far
};

}  // namespace gonio::http
