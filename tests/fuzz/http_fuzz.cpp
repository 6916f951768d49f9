// Feeds bytes to everything that reads a request: the head, the chunks and what headers hold. Only Failure
// may come out, of a status that is an error; a body must be the same however it arrives in pieces; a range
// must lie in its file.
#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "server/http/files.h"
#include "server/http/framing.h"
#include "server/http/negotiate.h"
#include "server/http/problem.h"

namespace {

using namespace gonio::http;

struct Decoded {
    std::string body;
    bool finished = false;
    size_t consumed = 0;
    int refused = 0;
};

Decoded decode(std::string_view bytes, size_t piece, size_t room) {
    ChunkDecoder decoder;
    Decoded result;
    std::string out(room, '\0');
    try {
        while (result.consumed < bytes.size() && !decoder.finished()) {
            const auto step = decoder.decode(bytes.substr(result.consumed, piece), out.data(), room);
            if (step.consumed == 0) __builtin_trap();
            result.body.append(out, 0, step.produced);
            result.consumed += step.consumed;
        }
    } catch (const Failure& failure) {
        result.refused = failure.problem.status;
    }
    result.finished = decoder.finished();
    return result;
}

void read_body(std::string_view bytes) {
    const Decoded whole = decode(bytes, bytes.size(), std::max<size_t>(1, bytes.size()));
    const Decoded pieces = decode(bytes, 3, 2);
    if (whole.finished != pieces.finished || whole.refused != pieces.refused) __builtin_trap();
    // A refusal takes with it what the same call had decoded before.
    if (!whole.refused && whole.body != pieces.body) __builtin_trap();
    if (whole.finished && whole.consumed != pieces.consumed) __builtin_trap();
}

void read_values(const RequestHead& head) {
    path_segments(head.target);
    query_parameters(head.target);
    for (const auto& [name, value] : head.headers) {
        if (value.find_first_of(std::string_view("\r\n\0", 3)) != std::string::npos) __builtin_trap();
        for (const uint64_t size : {uint64_t{0}, uint64_t{1}, uint64_t{1000}, UINT64_MAX}) {
            const RangeChoice choice = choose_range(value, size);
            if (choice.kind != RangeChoice::Kind::part) continue;
            if (choice.part.first > choice.part.last || choice.part.last >= size) __builtin_trap();
        }
        const Choice choices[] = {{"json", "application/json"}, {"csv", "text/csv"}};
        if (const auto chosen = negotiate(value, "", choices); chosen && *chosen > 1) __builtin_trap();
        matches_etag(value, "\"x\"");
        content_disposition(value);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    const HeadLimits limits;
    try {
        const auto end = find_head_end(bytes, limits);
        if (!end) return 0;
        const RequestHead head = parse_head(bytes.substr(0, *end), limits);
        if (head.headers.size() > limits.header_count || (head.chunked && head.content_length))
            __builtin_trap();
        if (head.chunked) read_body(bytes.substr(*end));
        read_values(head);
    } catch (const Failure& failure) {
        if (failure.problem.status < 400 || failure.problem.detail.empty()) __builtin_trap();
    }
    return 0;
}
