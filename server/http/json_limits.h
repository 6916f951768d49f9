// JSON from a client that nobody knows.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "server/http/message.h"
#include "server/json_node.h"

namespace gonio::http {

// Deeper than any document of ours, far from where nlohmann's recursive dump() overflows the stack.
constexpr int most_json_depth = 64;

// What parse_json_strictly() refuses (keys written twice, depth, invalid UTF-8, text behind the value) is
// thrown as its Error, before any value has been copied or printed. Throws Failure: 415 unless the body is
// application/json or application/*+json, 413 above `most` bytes.
nlohmann::json read_json(Request& request, uint64_t most);

}  // namespace gonio::http
