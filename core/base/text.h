// Numbers as text, for messages: the shortest form that reads back as the same number (std::to_string turns
// 1e-9 m into 0).
#pragma once
#include <charconv>
#include <string>

namespace gonio {

inline std::string number_text(double value) {
    char buffer[32];
    return {buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr};
}

// With so many significant digits.
inline std::string number_text(double value, int digits) {
    char buffer[64];
    return {buffer,
            std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, digits).ptr};
}

}  // namespace gonio
