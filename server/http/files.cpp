#include "server/http/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>

#include "base/error.h"
#include "server/http/problem.h"

namespace gonio::http {
namespace {

class OpenFile {
  public:
    explicit OpenFile(int descriptor) : descriptor_(descriptor) {}
    ~OpenFile() { ::close(descriptor_); }
    OpenFile(const OpenFile&) = delete;
    OpenFile& operator=(const OpenFile&) = delete;

    // Nothing if it is no regular file.
    std::optional<uint64_t> size() const {
        struct stat status {};
        if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
        return static_cast<uint64_t>(status.st_size);
    }

    // All of it in one call: the server looks between calls whether it should stop, and would cut it there.
    bool send(ByteRange part, BodyWriter& out) const {
        std::string block(256 << 10, '\0');
        for (uint64_t at = part.first; at <= part.last;) {
            const size_t want = static_cast<size_t>(std::min<uint64_t>(block.size(), part.last - at + 1));
            const ssize_t n = ::pread(descriptor_, block.data(), want, static_cast<off_t>(at));
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) return false;  // shorter than it was
            if (!out.write(std::string_view(block).substr(0, static_cast<size_t>(n)))) return false;
            at += static_cast<uint64_t>(n);
        }
        return true;
    }

  private:
    int descriptor_;
};

std::optional<uint64_t> whole_number(std::string_view digits) {
    uint64_t value = 0;
    const auto [end, failure] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (digits.empty() || digits[0] == '-' || end != digits.data() + digits.size()) return std::nullopt;
    // A number too large to hold is beyond any file, which is all that matters here.
    return failure == std::errc::result_out_of_range ? UINT64_MAX : value;
}

std::string base64_of_hex(std::string_view hex) {
    constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    uint32_t bits = 0;
    int held = 0;
    for (const char c : hex) {
        bits = bits << 4 | static_cast<uint32_t>(c <= '9' ? c - '0' : c - 'a' + 10);
        held += 4;
        if (held < 6) continue;
        held -= 6;
        text += letters[bits >> held & 63];
    }
    if (held) text += letters[bits << (6 - held) & 63];
    while (text.size() % 4) text += '=';
    return text;
}

}  // namespace

RangeChoice choose_range(std::string_view header, uint64_t size) {
    using Kind = RangeChoice::Kind;
    const size_t equals = header.find('=');
    if (equals == std::string_view::npos ||
        !equal_ignoring_case(trimmed(header.substr(0, equals)), "bytes")) {
        return {};
    }
    const std::string_view spec = trimmed(header.substr(equals + 1));
    const size_t dash = spec.find('-');
    if (dash == std::string_view::npos) return {};
    const auto first = whole_number(spec.substr(0, dash)), last = whole_number(spec.substr(dash + 1));
    const bool open_end = dash + 1 == spec.size();
    if (dash == 0) {  // "-500": the last 500
        if (!last) return {};
        if (*last == 0 || size == 0) return {Kind::unsatisfiable, {}};
        return {Kind::part, {size - std::min(size, *last), size - 1}};
    }
    if (!first || (!last && !open_end) || (last && *last < *first)) return {};
    if (*first >= size) return {Kind::unsatisfiable, {}};
    return {Kind::part, {*first, std::min(last.value_or(UINT64_MAX), size - 1)}};
}

bool matches_etag(std::string_view if_none_match, std::string_view etag) {
    for (std::string_view one : split_list(if_none_match, ',')) {
        if (one == "*") return true;
        if (one.starts_with("W/")) one.remove_prefix(2);
        if (one == etag) return true;
    }
    return false;
}

std::string content_disposition(const std::string& download_name) {
    std::string plain, encoded;
    for (const char c : download_name) {
        const bool safe = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                          c == '.' || c == '-' || c == '_';
        const bool printable = c >= ' ' && c < 0x7f && c != '"' && c != '\\' && c != '%' && c != '/';
        plain += printable ? c : '_';
        constexpr char hex[] = "0123456789ABCDEF";
        const auto byte = static_cast<unsigned char>(c);
        encoded += safe ? std::string(1, c) : std::string{'%', hex[byte >> 4], hex[byte & 15]};
    }
    return "attachment; filename=\"" + plain + "\"; filename*=UTF-8''" + encoded;
}

Response serve_file(const Request& request, const std::string& path, const FileOffer& offer) {
    // A FIFO would block here for ever, a symbolic link could lead anywhere.
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
    if (descriptor < 0) throw Error(ErrorCode::not_found, "", "", "there is no such file");
    return serve_file(request, descriptor, offer);
}

Response serve_file(const Request& request, int descriptor, const FileOffer& offer) {
    const auto file = std::make_shared<OpenFile>(descriptor);
    const auto size = file->size();
    if (!size) throw Error(ErrorCode::not_found, "", "", "there is no such file");

    Response response;
    response.set("Accept-Ranges", "bytes");
    response.set("Cache-Control", offer.immutable ? "public, max-age=31536000, immutable" : "no-cache");
    const std::string etag = offer.sha256.empty() ? "" : "\"" + offer.sha256 + "\"";
    if (!etag.empty()) {
        response.set("ETag", etag);
        if (matches_etag(request.header_list("If-None-Match"), etag)) {
            response.status = 304;
            return response;
        }
        // Of the whole, whatever part is sent (RFC 9530 section 3).
        response.set("Repr-Digest", "sha-256=:" + base64_of_hex(offer.sha256) + ":");
    }
    response.set("Content-Type", offer.media_type);
    if (!offer.download_name.empty()) {
        response.set("Content-Disposition", content_disposition(offer.download_name));
    }

    ByteRange part{0, *size - 1};
    // If-Range holds the tag of what the client already has; a date or a weak tag cannot vouch for it.
    const std::string if_range = request.header("If-Range");
    const bool same = if_range.empty() || (!etag.empty() && if_range == etag);
    if (request.method == "GET" && same && request.headers.count("Range") == 1) {
        const RangeChoice choice = choose_range(request.header("Range"), *size);
        if (choice.kind == RangeChoice::Kind::unsatisfiable) {
            Problem problem;
            problem.status = 416;
            problem.detail = "the file has " + std::to_string(*size) + " bytes";
            throw Failure(problem, {{"Content-Range", "bytes */" + std::to_string(*size)}});
        }
        if (choice.kind == RangeChoice::Kind::part) {
            part = choice.part;
            response.status = 206;
            response.set("Content-Range", "bytes " + std::to_string(part.first) + "-" +
                                              std::to_string(part.last) + "/" + std::to_string(*size));
        }
    }
    if (*size == 0) return response;
    response.stream_length = part.last - part.first + 1;
    response.stream = [file, part](BodyWriter& out) { return file->send(part, out); };
    return response;
}

uint64_t copy_body(Request& request, uint64_t most, const std::function<void(std::string_view)>& sink) {
    const auto too_large = [most] { fail(413, "the body may have " + std::to_string(most) + " bytes"); };
    if (request.body->length().value_or(0) > most) too_large();
    std::string block(64 << 10, '\0');
    uint64_t total = 0;
    while (const size_t n = request.body->read(block.data(), block.size())) {
        total += n;
        if (total > most) too_large();
        sink(std::string_view(block).substr(0, n));
    }
    return total;
}

}  // namespace gonio::http
