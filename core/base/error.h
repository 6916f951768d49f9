// The one exception type of gonio: bad input, found at a boundary, said so that the user can mend it.
#pragma once
#include <source_location>
#include <stdexcept>
#include <string>

namespace gonio {

#ifdef __cpp_lib_source_location
using SourceLocation = std::source_location;
#else
// Debian 12's clang (for the fuzz targets) does not have it yet.
struct SourceLocation {
    static constexpr SourceLocation current() { return {}; }
    constexpr const char* file_name() const { return ""; }
    constexpr unsigned line() const { return 0; }
};
#endif

enum class ErrorCode {
    usage,          // the command line itself is wrong
    invalid_input,  // a job, a surface or a table that cannot be used as it is
    missing_unit,   // a length whose unit nobody stated
    not_found,      // a file that is not there
    io,             // the system refused to read or write
    limit,          // larger than a configured limit
    unreachable,    // a service that does not answer
    cancelled,      // the user stopped the work
    internal,       // a defect of gonio
};

// As machines read it: "invalid_input", ...
constexpr const char* code_name(ErrorCode code) {
    switch (code) {
        case ErrorCode::usage:
            return "usage";
        case ErrorCode::invalid_input:
            return "invalid_input";
        case ErrorCode::missing_unit:
            return "missing_unit";
        case ErrorCode::not_found:
            return "not_found";
        case ErrorCode::io:
            return "io";
        case ErrorCode::limit:
            return "limit";
        case ErrorCode::unreachable:
            return "unreachable";
        case ErrorCode::cancelled:
            return "cancelled";
        case ErrorCode::internal:
            return "internal";
    }
    return "internal";
}

// `field` is the path of the offending value (a JSON pointer such as "/surface/width", or a file name),
// `value` what was found there, `what()` the whole sentence: field, value and what is allowed.
class Error : public std::runtime_error {
  public:
    Error(ErrorCode code, std::string field, std::string value, const std::string& allowed,
          SourceLocation where = SourceLocation::current())
        : std::runtime_error(sentence(field, value, allowed)),
          code_(code),
          field_(std::move(field)),
          value_(std::move(value)),
          allowed_(allowed),
          where_(where) {}

    ErrorCode code() const { return code_; }
    const std::string& field() const { return field_; }
    const std::string& value() const { return value_; }
    const std::string& allowed() const { return allowed_; }
    SourceLocation where() const { return where_; }

  private:
    static std::string sentence(const std::string& field, const std::string& value,
                                const std::string& allowed) {
        std::string text = field;
        if (!value.empty()) text += (text.empty() ? "" : " = ") + value;
        return text.empty() ? allowed : text + ": " + allowed;
    }
    ErrorCode code_;
    std::string field_, value_, allowed_;
    SourceLocation where_;
};

}  // namespace gonio
