// Who may use the server.
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace gonio::http {

class BearerTokens {
  public:
    // One token a line, with a name before it if there is a second word: "TOKEN" or "NAME TOKEN"; empty lines
    // and lines that begin with "#" are skipped. Throws Error: not_found, io, or invalid_input for a token
    // below 16 characters, one that cannot stand in a header, no token at all, or a file that others may read
    // or write.
    static BearerTokens read(const std::string& path);

    // Name ("line N" for a token without one) of the token in an Authorization header.
    std::optional<std::string> match(std::string_view authorization) const;
    // For a gate: the name, or Failure(401) with WWW-Authenticate.
    std::string demand(const Request& request) const;

  private:
    struct Token {
        std::string name;
        std::string digest;  // the token itself is not kept
    };
    std::vector<Token> tokens_;
};

// 127.0.0.0/8, ::1 or "localhost". What is no address is not: a bind to anything else needs a token.
bool is_loopback(const std::string& address);

}  // namespace gonio::http
