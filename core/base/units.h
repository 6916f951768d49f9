// Units of length as files and users spell them.
#pragma once
#include <array>
#include <optional>
#include <string_view>
#include <utility>

namespace gonio {

// Metres per unit; nothing for what is not a length known here. The micro sign comes as ASCII u, as either
// UTF-8 code point (micro sign, Greek mu) and, in older text exports, as the single Latin-1 byte.
inline std::optional<double> metres_per(std::string_view unit) {
    constexpr std::array<std::pair<std::string_view, double>, 15> units{{
        {"m", 1.0},
        {"mm", 1e-3},
        {"um", 1e-6},
        {"\xc2\xb5m", 1e-6},
        {"\xce\xbcm", 1e-6},
        {"\xb5m", 1e-6},
        {"nm", 1e-9},
        {"pm", 1e-12},
        {"fm", 1e-15},
        {"cm", 1e-2},
        {"dm", 1e-1},
        {"km", 1e3},
        {"\xc3\x85", 1e-10},
        {"in", 0.0254},
        {"Mm", 1e6},
    }};
    for (const auto& [name, metres] : units)
        if (name == unit) return metres;
    return std::nullopt;
}

}  // namespace gonio
