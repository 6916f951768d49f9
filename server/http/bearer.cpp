#include "server/http/bearer.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <sstream>

#include "base/error.h"
#include "base/sha256.h"
#include "server/http/problem.h"

namespace gonio::http {
namespace {

// Read through one descriptor, so that the file judged is the file read.
std::string read_secret_file(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0) {
        throw Error(errno == ENOENT ? ErrorCode::not_found : ErrorCode::io, path, "", std::strerror(errno));
    }
    struct stat status {};
    const bool known = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
    const bool shared = known && (status.st_mode & (S_IRWXG | S_IRWXO));
    constexpr size_t most = 1 << 20;
    std::string text(most, '\0');
    const ssize_t n = known && !shared ? ::read(descriptor, text.data(), most) : -1;
    ::close(descriptor);
    if (shared) {
        throw Error(ErrorCode::invalid_input, path, "",
                    "other users may use this file: take that from them with chmod 600");
    }
    if (n < 0) throw Error(ErrorCode::io, path, "", "cannot be read as a file of tokens");
    text.resize(static_cast<size_t>(n));
    return text;
}

// Time does not depend on where two digests differ.
bool equal_digests(std::string_view a, std::string_view b) {
    unsigned difference = a.size() != b.size();
    for (size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        difference |= static_cast<unsigned>(a[i] ^ b[i]);
    return difference == 0;
}

}  // namespace

BearerTokens BearerTokens::read(const std::string& path) {
    BearerTokens result;
    std::istringstream file(read_secret_file(path));
    int number = 0;
    for (std::string line; std::getline(file, line);) {
        ++number;
        std::istringstream words(line);
        std::string first, second, third;
        words >> first >> second >> third;
        if (first.empty() || first[0] == '#') continue;
        const std::string where = "line " + std::to_string(number);
        const std::string& token = second.empty() ? first : second;
        // Neither the message nor a log may show it.
        if (!third.empty())
            throw Error(ErrorCode::invalid_input, path, where, "more than a name and a token");
        constexpr size_t least = 16;
        if (token.size() < least) {
            throw Error(ErrorCode::invalid_input, path, where,
                        "a token needs at least " + std::to_string(least) + " characters");
        }
        if (!std::all_of(token.begin(), token.end(), [](char c) { return c > ' ' && c < 0x7f; })) {
            throw Error(ErrorCode::invalid_input, path, where, "a token may hold visible ASCII alone");
        }
        result.tokens_.push_back({second.empty() ? where : first, sha256_hex(token)});
    }
    if (result.tokens_.empty()) throw Error(ErrorCode::invalid_input, path, "", "there is no token in it");
    return result;
}

std::optional<std::string> BearerTokens::match(std::string_view authorization) const {
    constexpr std::string_view scheme = "Bearer ";
    if (!equal_ignoring_case(authorization.substr(0, scheme.size()), scheme)) return std::nullopt;
    const std::string digest = sha256_hex(trimmed(authorization.substr(scheme.size())));
    const Token* found = nullptr;
    for (const Token& token : tokens_) {  // all of them, whichever matches
        if (equal_digests(token.digest, digest)) found = &token;
    }
    return found ? std::optional(found->name) : std::nullopt;
}

std::string BearerTokens::demand(const Request& request) const {
    const std::string header = request.header("Authorization");
    if (auto name = match(header)) return *name;
    Problem problem;
    problem.status = 401;
    problem.detail = header.empty() ? "send Authorization: Bearer TOKEN" : "this token is not known";
    const std::string challenge = header.empty() ? "Bearer" : "Bearer error=\"invalid_token\"";
    throw Failure(problem, {{"WWW-Authenticate", challenge}});
}

bool is_loopback(const std::string& address) {
    if (address == "localhost") return true;
    in_addr four{};
    if (::inet_pton(AF_INET, address.c_str(), &four) == 1) return ntohl(four.s_addr) >> 24 == 127;
    in6_addr six{};
    return ::inet_pton(AF_INET6, address.c_str(), &six) == 1 && IN6_IS_ADDR_LOOPBACK(&six);
}

}  // namespace gonio::http
