// The HTTP layer without sockets: what is a request, what an error looks like, which part of which
// representation is sent, whose token it is. Sockets and attacks: tests/end_to_end/http_attacks_test.py.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "base/error.h"
#include "server/http/bearer.h"
#include "server/http/events.h"
#include "server/http/files.h"
#include "server/http/framing.h"
#include "server/http/json_limits.h"
#include "server/http/negotiate.h"
#include "server/http/problem.h"
#include "server/http/router.h"

namespace gonio::http {
namespace {

using nlohmann::json;

// The status of what a request is refused with; 0 if it is not.
int status_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Failure& failure) {
        return failure.problem.status;
    }
    return 0;
}

RequestHead head_of(const std::string& lines) {
    return parse_head(lines + "\r\n", {});
}

TEST(Framing, ReadsAHead) {
    const RequestHead head = head_of(
        "PUT /a?b=c HTTP/1.1\r\nhost: x\r\nX-A:  a%0d b \r\nConnection: foo, Close\r\n"
        "Expect: 100-continue\r\nContent-Length: 007\r\n");
    EXPECT_EQ(head.method, "PUT");
    EXPECT_EQ(head.target, "/a?b=c");
    EXPECT_EQ(head.headers.find("x-a")->second, "a%0d b");
    EXPECT_EQ(head.content_length, 7u);
    EXPECT_FALSE(head.keep_alive);
    EXPECT_TRUE(head.expects_continue);
    EXPECT_TRUE(head_of("GET / HTTP/1.1\r\nHost: x\r\n").keep_alive);
    EXPECT_FALSE(head_of("GET / HTTP/1.0\r\n").keep_alive);
}

TEST(Framing, FindsTheEndOfAHead) {
    HeadLimits limits;
    EXPECT_EQ(find_head_end("GET / HTTP/1.1\r\nA: b\r\n\r\nrest", limits), 24u);
    EXPECT_EQ(find_head_end("GET / HTTP/1.1\r\nA: b\r\n\r", limits), std::nullopt);
    EXPECT_EQ(status_of([&] { find_head_end("GET / HTTP/1.1\n", limits); }), 400);
    limits.header_bytes = 20;
    EXPECT_EQ(status_of([&] { find_head_end("GET / HTTP/1.1\r\nA: b\r\n\r\n", limits); }), 431);
    limits.header_bytes = 24;
    EXPECT_EQ(find_head_end("GET / HTTP/1.1\r\nA: b\r\n\r\n", limits), 24u);
}

TEST(Framing, RefusesWhatTwoReadersCouldReadInTwoManners) {
    const std::string post = "POST / HTTP/1.1\r\nHost: x\r\n";
    EXPECT_EQ(status_of([&] { head_of(post + "Content-Length: 5\r\n"); }), 0);
    for (const char* lines :
         {"Content-Length: 5\r\nContent-Length: 5\r\n", "Content-Length: 5, 5\r\n", "Content-Length: +5\r\n",
          "Content-Length: \r\n", "Content-Length: 0x5\r\n", "Content-Length : 5\r\n",
          "Content-Length: 5\x01\r\n", "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
          "Content-Length: 5\r\n folded\r\n", "Content-Length: 5\r\nHost: y\r\n",
          "Content-Length: 1111111111111111\r\n", ": 5\r\n", "x\r\n",
          "Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n"}) {
        EXPECT_EQ(status_of([&] { head_of(post + lines); }), 400) << lines;
    }
    EXPECT_EQ(status_of([&] { head_of(post + "Transfer-Encoding: chunked, gzip\r\n"); }), 501);
    EXPECT_EQ(status_of([&] { head_of(post); }), 411);
    EXPECT_EQ(status_of([] { head_of("GET / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n"); }), 400);
    EXPECT_EQ(status_of([] { head_of("POST / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n"); }), 400);
}

TEST(Framing, DecodesChunksInPieces) {
    const std::string body = "5;a=\"b\"\r\nhello\r\nA\r\n0123456789\r\n0\r\nT: x\r\n\r\nnext";
    for (const size_t piece : {1, 2, 7, 100}) {
        ChunkDecoder decoder;
        std::string decoded;
        char out[4];
        size_t at = 0;
        while (!decoder.finished()) {
            const auto step = decoder.decode(std::string_view(body).substr(at, piece), out, sizeof out);
            at += step.consumed;
            decoded.append(out, step.produced);
        }
        EXPECT_EQ(decoded, "hello0123456789");
        EXPECT_EQ(body.substr(at), "next");
    }
    for (const char* bad :
         {"-2\r\n", "g\r\n", "\r\n", "5 \r\n", "5\n", "5\r\nhellox", "0\r\n\rx", "1000000000000000\r\n"}) {
        char out[16];
        EXPECT_EQ(status_of([&] { ChunkDecoder().decode(bad, out, sizeof out); }), 400) << bad;
    }
    const std::string endless = "5;" + std::string(10000, 'x');
    char out[1];
    EXPECT_EQ(status_of([&] { ChunkDecoder().decode(endless, out, 1); }), 400);
}

TEST(Framing, DecodesAddresses) {
    EXPECT_EQ(path_segments("/a/b%2Fc//?d/e"), (std::vector<std::string>{"a", "b/c", "", ""}));
    const auto query = query_parameters("/a?x=1+2&y=%2B&z&=&x=3");
    EXPECT_EQ(query.count("x"), 2u);
    EXPECT_EQ(query.find("x")->second, "1 2");
    EXPECT_EQ(query.find("y")->second, "+");
    EXPECT_EQ(query.find("z")->second, "");
    for (const char* bad : {"/%", "/%4", "/%4g", "/%00", "/%0a", "/%7F"}) {
        EXPECT_EQ(status_of([&] { path_segments(bad); }), 400) << bad;
    }
}

TEST(Router, PrefersTextsAndNamesWhatIsAllowed) {
    Router router;
    const auto named = [](std::string name) {
        return [name](Request&) { return Response{200, {}, name, nullptr, {}}; };
    };
    router.add("GET", "/jobs/{}", named("one"));
    router.add("GET", "/jobs/all", named("all"));
    router.add("DELETE", "/jobs/{}", named("delete"));
    const auto answer = [&](const std::string& method, const std::string& target) {
        Request request;
        request.method = method;
        request.target = target;
        std::string text = router.find(request)(request).body;
        for (const std::string& capture : request.captures) text += " " + capture;
        return text;
    };
    EXPECT_EQ(answer("GET", "/jobs/all"), "all");
    EXPECT_EQ(answer("GET", "/jobs/7%2f8?x=1"), "one 7/8");
    EXPECT_EQ(answer("HEAD", "/jobs/7"), "one 7");
    EXPECT_EQ(answer("DELETE", "/jobs/7"), "delete 7");
    for (const char* missing : {"/", "/jobs", "/jobs/", "/jobs/7/", "/Jobs/7"}) {
        EXPECT_EQ(status_of([&] { answer("GET", missing); }), 404) << missing;
    }
    try {
        answer("POST", "/jobs/7");
        ADD_FAILURE();
    } catch (const Failure& failure) {
        EXPECT_EQ(failure.problem.status, 405);
        EXPECT_EQ(failure.headers.find("Allow")->second, "DELETE, GET, HEAD");
    }
}

json document(const std::function<void()>& action) {
    try {
        action();
    } catch (...) {
        const Response response = problem_response(std::current_exception(), "/v1/jobs");
        EXPECT_EQ(response.headers.find("content-type")->second, "application/problem+json");
        json parsed = json::parse(response.body);
        EXPECT_EQ(parsed.at("status"), response.status);
        return parsed;
    }
    ADD_FAILURE() << "nothing was refused";
    return {};
}

TEST(Problems, ErrorsBecomeDocuments) {
    const json problem = document(
        [] { throw Error(ErrorCode::missing_unit, "/surface/width", "5", "a length needs a unit"); });
    const json expected = {
        {"type", "about:blank"},
        {"title", "Bad Request"},
        {"status", 400},
        {"detail", "/surface/width = 5: a length needs a unit"},
        {"instance", "/v1/jobs"},
        {"code", "missing_unit"},
        {"errors", {{{"pointer", "/surface/width"}, {"detail", "5: a length needs a unit"}}}}};
    EXPECT_EQ(problem, expected);
    const std::pair<ErrorCode, int> statuses[] = {
        {ErrorCode::usage, 400},   {ErrorCode::invalid_input, 400}, {ErrorCode::not_found, 404},
        {ErrorCode::limit, 413},   {ErrorCode::cancelled, 409},     {ErrorCode::io, 503},
        {ErrorCode::internal, 500}};
    for (const auto& [code, status] : statuses) {
        EXPECT_EQ(document([code = code] { throw Error(code, "", "", "x"); }).at("status"), status);
    }
}

TEST(Problems, SecretsStayInside) {
    for (const json& problem :
         {document([] { throw Error(ErrorCode::internal, "/etc/a", "secret", "secret"); }),
          document([] { throw Error(ErrorCode::io, "/etc/a", "secret", "secret"); }),
          document([] { throw std::runtime_error("secret /etc/a"); }), document([] { throw 5; })}) {
        EXPECT_EQ(problem.dump().find("secret"), std::string::npos);
        EXPECT_EQ(problem.dump().find("/etc"), std::string::npos);
        EXPECT_GE(problem.at("status"), 500);
    }
}

TEST(Problems, OtherTypesAndBytesThatAreNoText) {
    const std::string type = "http://www.opengis.net/def/exceptions/ogcapi-processes-1/1.0/no-such-job";
    const json problem = document([&] { fail(404, "no job \xff", type); });
    EXPECT_EQ(problem.at("type"), type);
    EXPECT_EQ(problem.at("title"), "Not Found");
    EXPECT_EQ(problem.at("detail"), "no job \xEF\xBF\xBD");
}

class TextBody : public BodyReader {
  public:
    explicit TextBody(std::string text, bool announced = true)
        : text_(std::move(text)), announced_(announced) {}
    size_t read(char* buffer, size_t size) override {
        const size_t n = text_.copy(buffer, std::min<size_t>(size, 3), at_);  // in small pieces
        at_ += n;
        return n;
    }
    std::optional<uint64_t> length() const override {
        return announced_ ? std::optional<uint64_t>(text_.size()) : std::nullopt;
    }
    size_t taken() const { return at_; }

  private:
    std::string text_;
    bool announced_;
    size_t at_ = 0;
};

json read_json_text(const std::string& text, const std::string& type = "application/json") {
    TextBody body(text, false);
    Request request;
    request.body = &body;
    request.headers.emplace("content-type", type);
    return read_json(request, 1000);
}

TEST(Json, LimitsOfABody) {
    EXPECT_EQ(read_json_text(R"({"a": [1, 2]})").dump(), R"({"a":[1,2]})");
    EXPECT_EQ(read_json_text("1", "Application/LD+JSON; charset=utf-8"), 1);
    EXPECT_EQ(status_of([] { read_json_text("1", "text/plain"); }), 415);
    EXPECT_EQ(status_of([] { read_json_text("1", ""); }), 415);
    EXPECT_EQ(status_of([] { read_json_text(std::string(1001, ' ')); }), 413);
    const std::string deep(most_json_depth, '['), closed(most_json_depth, ']');
    EXPECT_NO_THROW(read_json_text(deep + closed));
    EXPECT_THROW(read_json_text("[" + deep + closed + "]"), Error);
    EXPECT_THROW(read_json_text("\"\xff\""), Error);
    EXPECT_THROW(read_json_text("{} x"), Error);
}

TEST(Json, AKeyWrittenTwiceIsPointedAt) {
    const std::pair<const char*, const char*> documents[] = {
        {R"({"a": 1, "a": 1})", "/a"},
        {R"({"x": {"a": [0, [], {"b": 1, "c/d": 2, "c/d": 3}]}})", "/x/a/2/c~1d"},
        {R"([{"a": 1}, [7, {"a": [1, 2], "b": {}, "a": 1}]])", "/1/1/a"}};
    for (const auto& [text, pointer] : documents) {
        try {
            read_json_text(text);
            ADD_FAILURE() << text;
        } catch (const Error& error) {
            EXPECT_EQ(error.field(), pointer);
        }
    }
    EXPECT_NO_THROW(read_json_text(R"([{"a": 1}, {"a": {"a": 1}}])"));
}

TEST(Files, UploadsAreStreamedUpToALimit) {
    const auto upload = [](TextBody& body, uint64_t most) {
        Request request;
        request.body = &body;
        std::string got;
        copy_body(request, most, [&](std::string_view piece) { got += piece; });
        return got;
    };
    TextBody fits("0123456789"), announced("0123456789"), chunked("0123456789", false);
    EXPECT_EQ(upload(fits, 10), "0123456789");
    EXPECT_EQ(status_of([&] { upload(announced, 9); }), 413);
    EXPECT_EQ(announced.taken(), 0u);
    EXPECT_EQ(status_of([&] { upload(chunked, 5); }), 413);
    EXPECT_EQ(chunked.taken(), 6u);
}

std::string range_text(std::string_view header, uint64_t size) {
    const RangeChoice choice = choose_range(header, size);
    if (choice.kind == RangeChoice::Kind::whole) return "whole";
    if (choice.kind == RangeChoice::Kind::unsatisfiable) return "none";
    return std::to_string(choice.part.first) + "-" + std::to_string(choice.part.last);
}

TEST(Files, Ranges) {
    EXPECT_EQ(range_text("bytes=0-0", 10), "0-0");
    EXPECT_EQ(range_text("Bytes = 2-5", 10), "2-5");
    EXPECT_EQ(range_text("bytes=2-", 10), "2-9");
    EXPECT_EQ(range_text("bytes=2-100", 10), "2-9");
    EXPECT_EQ(range_text("bytes=2-99999999999999999999999", 10), "2-9");
    EXPECT_EQ(range_text("bytes=-3", 10), "7-9");
    EXPECT_EQ(range_text("bytes=-30", 10), "0-9");
    EXPECT_EQ(range_text("bytes=10-", 10), "none");
    EXPECT_EQ(range_text("bytes=99999999999999999999999-", 10), "none");
    EXPECT_EQ(range_text("bytes=-0", 10), "none");
    EXPECT_EQ(range_text("bytes=0-", 0), "none");
    EXPECT_EQ(range_text("bytes=-1", 0), "none");
    for (const char* ignored :
         {"", "bytes", "bytes=", "bytes=-", "bytes=5", "bytes=5-2", "bytes=1-2,3-4", "lines=1-2", "bytes=a-b",
          "bytes=1-b", "bytes=--1", "bytes=1--2", "bytes=+1-2"}) {
        EXPECT_EQ(range_text(ignored, 10), "whole") << ignored;
    }
}

TEST(Files, TagsAndNames) {
    EXPECT_TRUE(matches_etag("\"a\", W/\"b\"", "\"b\""));
    EXPECT_TRUE(matches_etag("*", "\"b\""));
    EXPECT_FALSE(matches_etag("\"a\", \"bb\"", "\"b\""));
    EXPECT_FALSE(matches_etag("", "\"b\""));
    EXPECT_EQ(content_disposition("a \"b\"\r\n\xC3\xBC.csv"),
              "attachment; filename=\"a _b_____.csv\"; filename*=UTF-8''a%20%22b%22%0D%0A%C3%BC.csv");
}

TEST(Negotiation, QualitiesAndOverride) {
    const Choice choices[] = {{"json", "application/json"}, {"csv", "text/csv"}, {"exr", "image/x-exr"}};
    const auto chosen = [&](std::string_view accept, std::string_view name = "") {
        const auto index = negotiate(accept, name, choices);
        return index ? choices[*index].name : "none";
    };
    EXPECT_EQ(chosen(""), "json");
    EXPECT_EQ(chosen("*/*"), "json");
    EXPECT_EQ(chosen("text/csv"), "csv");
    EXPECT_EQ(chosen("TEXT/*;q=0.2, image/x-exr;q=0.3"), "exr");
    EXPECT_EQ(chosen("application/json;q=0.5, text/csv;q=0.5"), "json");
    EXPECT_EQ(chosen("application/json;q=0, */*"), "csv");
    EXPECT_EQ(chosen("text/*, text/csv;q=0.1, application/json;q=0.5"), "json");
    EXPECT_EQ(chosen("text/csv;q=2, image/x-exr;q=0.001"), "exr");
    EXPECT_EQ(chosen("text/csv;q=x"), "none");
    EXPECT_EQ(chosen("text/html"), "none");
    EXPECT_EQ(chosen("text/html", "exr"), "exr");
    EXPECT_EQ(chosen("*/*", "png"), "none");
    const Problem problem = not_acceptable(choices);
    EXPECT_EQ(problem.status, 406);
    EXPECT_NE(problem.detail.find("image/x-exr (?f=exr)"), std::string::npos);
}

TEST(Events, Format) {
    EXPECT_EQ(format_event({"7", "progress", "{}"}), "id: 7\nevent: progress\ndata: {}\n\n");
    EXPECT_EQ(format_event({"", "", "a\nb\r\nc\rd"}), "data: a\ndata: b\ndata: c\ndata: d\n\n");
    EXPECT_EQ(format_event({"", "", ""}), "data: \n\n");
    EXPECT_EQ(format_event({"1\nid: 2", "x\r\ndata: y", "z"}), "id: 1id: 2\nevent: xdata: y\ndata: z\n\n");
}

TEST(Events, PlacesAreGivenBack) {
    EventStreams streams(1);
    const EventSource source = [](const std::string&, std::chrono::milliseconds) { return EventBatch{}; };
    {
        const Response open = streams.open({}, source);
        EXPECT_EQ(streams.count(), 1);
        EXPECT_EQ(status_of([&] { streams.open({}, source); }), 503);
        EXPECT_EQ(streams.count(), 1);
    }
    EXPECT_EQ(streams.count(), 0);
    EXPECT_EQ(status_of([&] { streams.open({}, source); }), 0);
}

class Tokens : public testing::Test {
  protected:
    void write(const std::string& text, mode_t mode = 0600) {
        std::ofstream(path_) << text;
        ::chmod(path_.c_str(), mode);
    }
    ErrorCode refusal() {
        try {
            BearerTokens::read(path_);
        } catch (const Error& error) {
            EXPECT_EQ(std::string(error.what()).find("secret"), std::string::npos) << error.what();
            return error.code();
        }
        ADD_FAILURE() << "nothing was refused";
        return ErrorCode::internal;
    }
    void TearDown() override { std::filesystem::remove(path_); }
    const std::string path_ = testing::TempDir() + "gonio_tokens_" + std::to_string(::getpid());
};

TEST_F(Tokens, AreMatchedByName) {
    write("# comment\n\nalice 0123456789abcdef\n  fedcba9876543210\r\n");
    const BearerTokens tokens = BearerTokens::read(path_);
    EXPECT_EQ(tokens.match("Bearer 0123456789abcdef"), "alice");
    EXPECT_EQ(tokens.match("bearer fedcba9876543210"), "line 4");
    for (const char* wrong : {"", "Bearer", "Bearer ", "Bearer 0123456789abcde", "Bearer 0123456789abcdef0",
                              "Basic 0123456789abcdef", "0123456789abcdef", "Bearer alice"}) {
        EXPECT_EQ(tokens.match(wrong), std::nullopt) << wrong;
    }
    Request request;
    EXPECT_EQ(status_of([&] { tokens.demand(request); }), 401);
    request.headers.emplace("Authorization", "Bearer 0123456789abcdef");
    EXPECT_EQ(tokens.demand(request), "alice");
}

TEST_F(Tokens, FilesThatAreRefused) {
    EXPECT_EQ(refusal(), ErrorCode::not_found);
    write("# nothing\n");
    EXPECT_EQ(refusal(), ErrorCode::invalid_input);
    write("secret-too-shor\n");
    EXPECT_EQ(refusal(), ErrorCode::invalid_input);
    write("a b secret-0123456789abcdef\n");
    EXPECT_EQ(refusal(), ErrorCode::invalid_input);
    write("secret-0123456789abc\xC3\xBC\n");
    EXPECT_EQ(refusal(), ErrorCode::invalid_input);
    for (const mode_t mode : {0640, 0604, 0620, 0666}) {
        write("0123456789abcdef\n", mode);
        EXPECT_EQ(refusal(), ErrorCode::invalid_input) << mode;
    }
}

TEST(Loopback, Addresses) {
    for (const char* inside : {"127.0.0.1", "127.9.9.9", "::1", "localhost"})
        EXPECT_TRUE(is_loopback(inside));
    for (const char* outside :
         {"0.0.0.0", "::", "10.0.0.1", "128.0.0.1", "example.org", "", "127.0.0.1.example.org"}) {
        EXPECT_FALSE(is_loopback(outside)) << outside;
    }
}

}  // namespace
}  // namespace gonio::http
