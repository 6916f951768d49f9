#include "server/http/framing.h"

#include <algorithm>
#include <cstring>
#include <set>

#include "server/http/problem.h"

namespace gonio::http {
namespace {

bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

bool is_token_char(char c) {
    return is_digit(c) || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
           (c != '\0' && std::strchr("!#$%&'*+-.^_`|~", c));
}

bool is_token(std::string_view text) {
    return !text.empty() && std::all_of(text.begin(), text.end(), is_token_char);
}

bool is_control(char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20 || byte == 0x7f;
}

// -1 if it is none.
int hex_digit(char c) {
    if (is_digit(c)) return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

// The next line without its CR LF, which is there: the head ends with a blank line and has no bare line feed.
std::string_view take_line(std::string_view& text) {
    const size_t end = text.find("\r\n");
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 2, text.size()));
    return line;
}

uint64_t parse_length(std::string_view value) {
    // Signs, spaces and lists ("5, 5") are where two readers disagree; 15 digits cannot overflow.
    if (value.empty() || value.size() > 15 || !std::all_of(value.begin(), value.end(), is_digit)) {
        fail(400, "Content-Length must be one whole number");
    }
    uint64_t length = 0;
    for (const char c : value) length = length * 10 + static_cast<uint64_t>(c - '0');
    return length;
}

struct Version {
    bool is_1_0 = false;
};

Version parse_request_line(std::string_view line, RequestHead& head, const HeadLimits& limits) {
    const size_t first = line.find(' '), last = line.rfind(' ');
    if (first == std::string_view::npos || first == last) fail(400, "the request line has not three parts");
    const std::string_view method = line.substr(0, first), version = line.substr(last + 1);
    const std::string_view target = line.substr(first + 1, last - first - 1);
    if (!is_token(method)) fail(400, "the method is not a token");
    static const std::set<std::string, std::less<>> known = {"GET",   "HEAD",   "POST",   "PUT",
                                                             "PATCH", "DELETE", "OPTIONS"};
    if (!known.contains(method)) fail(501, "this method is not implemented");
    if (version != "HTTP/1.1" && version != "HTTP/1.0") {
        if (version.starts_with("HTTP/")) fail(505, "HTTP/1.1 is spoken here");
        fail(400, "the request line does not end with a version");
    }
    if (target.size() > limits.target_bytes) fail(414, "the address is longer than the limit");
    const auto visible = [](char c) { return c > ' ' && c < 0x7f; };
    if (!target.starts_with('/') || !std::all_of(target.begin(), target.end(), visible) ||
        target.find('#') != std::string_view::npos) {
        fail(400, "the address must be a path of visible ASCII characters");
    }
    head.method = method;
    head.target = target;
    return {version == "HTTP/1.0"};
}

void parse_header_line(std::string_view line, RequestHead& head) {
    const size_t colon = line.find(':');
    // A name that ends in a space and a line that begins with one (folding) are no tokens either.
    if (colon == std::string_view::npos || !is_token(line.substr(0, colon))) {
        fail(400, "a header line has no proper name");
    }
    const std::string_view value = trimmed(line.substr(colon + 1));
    if (std::any_of(value.begin(), value.end(), [](char c) { return is_control(c) && c != '\t'; })) {
        fail(400, "a header holds a control character");
    }
    head.headers.emplace(line.substr(0, colon), value);
}

// What the headers say of the body and of the connection.
void interpret_headers(RequestHead& head, Version version) {
    const auto single = [&head](const char* name) -> std::optional<std::string_view> {
        const size_t count = head.headers.count(name);
        if (count > 1) fail(400, std::string(name) + " is given twice");
        return count ? std::optional<std::string_view>(head.headers.find(name)->second) : std::nullopt;
    };
    const auto length = single("Content-Length"), coding = single("Transfer-Encoding");
    if (const auto host = single("Host"); !host && !version.is_1_0) fail(400, "there is no Host");
    if (length && coding) fail(400, "Content-Length and Transfer-Encoding exclude each other");
    if (length) head.content_length = parse_length(*length);
    if (coding) {
        if (version.is_1_0) fail(400, "HTTP/1.0 has no Transfer-Encoding");
        if (!equal_ignoring_case(*coding, "chunked")) fail(501, "the only transfer coding is chunked");
        head.chunked = true;
    }
    if (head.headers.contains("Content-Encoding")) {
        // A few kilobytes can unpack to gigabytes.
        fail(415, "compressed bodies are not accepted");
    }
    const bool takes_body = head.method == "POST" || head.method == "PUT" || head.method == "PATCH";
    if (takes_body && !length && !coding) fail(411, "say the length, or send chunks");
    if (!takes_body && head.has_body()) fail(400, head.method + " takes no body here");

    head.keep_alive = !version.is_1_0;
    const auto [begin, end] = head.headers.equal_range("Connection");
    for (auto one = begin; one != end; ++one) {
        for (const std::string_view option : split_list(one->second, ',')) {
            if (equal_ignoring_case(option, "close")) head.keep_alive = false;
        }
    }
    if (const auto expected = single("Expect")) {
        if (!equal_ignoring_case(*expected, "100-continue")) fail(417, "only 100-continue can be expected");
        head.expects_continue = head.has_body() && !version.is_1_0;
    }
}

}  // namespace

std::optional<size_t> find_head_end(std::string_view bytes, const HeadLimits& limits) {
    const std::string_view within = bytes.substr(0, limits.header_bytes);
    size_t line_start = 0;
    for (size_t feed; (feed = within.find('\n', line_start)) != std::string_view::npos;) {
        if (feed == 0 || within[feed - 1] != '\r') fail(400, "a line ends without a carriage return");
        if (feed - 1 == line_start) return feed + 1;
        line_start = feed + 1;
    }
    if (bytes.size() >= limits.header_bytes) fail(431, "the headers are larger than the limit");
    return std::nullopt;
}

RequestHead parse_head(std::string_view head, const HeadLimits& limits) {
    RequestHead parsed;
    const Version version = parse_request_line(take_line(head), parsed, limits);
    size_t count = 0;
    for (std::string_view line = take_line(head); !line.empty(); line = take_line(head)) {
        if (++count > limits.header_count) fail(431, "there are more headers than the limit");
        parse_header_line(line, parsed);
    }
    interpret_headers(parsed, version);
    return parsed;
}

std::string percent_decoded(std::string_view text) {
    std::string decoded;
    for (size_t i = 0; i < text.size(); ++i) {
        char c = text[i];
        if (c == '%') {
            const int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
            const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
            if (low < 0) fail(400, "a % in the address is not followed by two hexadecimal digits");
            c = static_cast<char>(high * 16 + low);
            if (is_control(c)) fail(400, "the address holds a control character");
            i += 2;
        }
        decoded += c;
    }
    return decoded;
}

std::vector<std::string> path_segments(std::string_view target) {
    std::string_view path = target.substr(0, target.find('?'));
    std::vector<std::string> segments;
    while (!path.empty()) {
        path.remove_prefix(1);  // "/"
        const size_t end = std::min(path.find('/'), path.size());
        segments.push_back(percent_decoded(path.substr(0, end)));
        path.remove_prefix(end);
    }
    return segments;
}

std::multimap<std::string, std::string> query_parameters(std::string_view target) {
    std::multimap<std::string, std::string> parameters;
    const size_t mark = target.find('?');
    if (mark == std::string_view::npos) return parameters;
    std::string query(target.substr(mark + 1));
    std::replace(query.begin(), query.end(), '+', ' ');
    for (const std::string_view part : split_list(query, '&')) {
        const size_t equals = std::min(part.find('='), part.size());
        parameters.emplace(percent_decoded(part.substr(0, equals)),
                           percent_decoded(part.substr(std::min(equals + 1, part.size()))));
    }
    return parameters;
}

ChunkDecoder::Step ChunkDecoder::decode(std::string_view in, char* out, size_t out_size) {
    Step done;
    while (done.consumed < in.size() && !finished()) {
        if (state_ != State::data) {
            step(in[done.consumed++]);
            continue;
        }
        const size_t n = std::min({in.size() - done.consumed, out_size - done.produced,
                                   static_cast<size_t>(std::min<uint64_t>(left_, SIZE_MAX))});
        if (n == 0) break;  // `out` is full
        std::memcpy(out + done.produced, in.data() + done.consumed, n);
        done.consumed += n;
        done.produced += n;
        left_ -= n;
        if (left_ == 0) state_ = State::data_cr;
    }
    return done;
}

void ChunkDecoder::step(char c) {
    const auto expect = [c](char wanted) {
        if (c != wanted) fail(400, "the body is not properly chunked");
    };
    const auto count_extra = [this, c] {
        constexpr size_t most = 8 << 10;
        if (++extra_ > most || (is_control(c) && c != '\t')) fail(400, "the body is not properly chunked");
    };
    switch (state_) {
        case State::size:
            if (const int digit = hex_digit(c); digit >= 0) {
                if (++digits_ > 15) fail(400, "a chunk is larger than any body may be");
                left_ = left_ * 16 + static_cast<uint64_t>(digit);
                return;
            }
            if (digits_ == 0) fail(400, "the size of a chunk is no hexadecimal number");
            if (c == ';') {
                state_ = State::extension;
                return;
            }
            expect('\r');
            state_ = State::size_lf;
            return;
        case State::extension:
            if (c == '\r') {
                state_ = State::size_lf;
            } else {
                count_extra();
            }
            return;
        case State::size_lf:
            expect('\n');
            state_ = left_ ? State::data : State::trailer_start;
            digits_ = 0;
            return;
        case State::data_cr:
            expect('\r');
            state_ = State::data_lf;
            return;
        case State::data_lf:
            expect('\n');
            state_ = State::size;
            return;
        case State::trailer_start:
            if (c == '\r') {
                state_ = State::end_lf;
                return;
            }
            count_extra();
            state_ = State::trailer;
            return;
        case State::trailer:  // trailers are read over: nothing here needs one
            if (c == '\r') {
                state_ = State::trailer_lf;
            } else {
                count_extra();
            }
            return;
        case State::trailer_lf:
            expect('\n');
            state_ = State::trailer_start;
            return;
        case State::end_lf:
            expect('\n');
            state_ = State::finished;
            return;
        case State::data:
        case State::finished:
            return;
    }
}

}  // namespace gonio::http
