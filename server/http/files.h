// Large bodies in both directions, never held in memory.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/http/message.h"

namespace gonio::http {

struct FileOffer {
    std::string media_type = "application/octet-stream";
    std::string sha256;         // of the content, 64 hex digits: ETag and Repr-Digest; "" for neither
    std::string download_name;  // "" to show it where it is
    bool immutable = false;     // the address names this content for ever
};

// 200, 206, 304 or 416, for GET and HEAD. Throws Error(not_found) if it is no file that can be read.
Response serve_file(const Request& request, const std::string& path, const FileOffer& offer);
// The same of an open file, which it owns. It may be deleted while it is sent.
Response serve_file(const Request& request, int descriptor, const FileOffer& offer);

// First and last byte.
struct ByteRange {
    uint64_t first = 0, last = 0;
};
struct RangeChoice {
    enum class Kind { whole, part, unsatisfiable } kind = Kind::whole;
    ByteRange part;
};
// What a Range header asks of `size` bytes, clamped to them. Several ranges are answered with the whole, as
// RFC 9110 section 14.2 allows: 500 times "0-" in one small request would be 500 times the file. So is what
// is no range of bytes.
RangeChoice choose_range(std::string_view header, uint64_t size);

// Whether an If-None-Match names `etag` (with its quotes): compared weakly, as caches do.
bool matches_etag(std::string_view if_none_match, std::string_view etag);

// `attachment` with the name as UTF-8 (RFC 6266); what could end the quoted text becomes "_".
std::string content_disposition(const std::string& download_name);

// Reads the body to its end in pieces. Throws Failure(413) above `most`: before the first byte is read where
// the client says the length.
uint64_t copy_body(Request& request, uint64_t most, const std::function<void(std::string_view)>& sink);

}  // namespace gonio::http
