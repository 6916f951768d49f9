#include "server/lengths.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "base/error.h"

namespace gonio {
namespace {

struct LengthUnit {
    std::string_view name;
    int exponent;  // power of ten, in metres
};

constexpr std::array<LengthUnit, 9> units{{{"km", 3},
                                           {"m", 0},
                                           {"cm", -2},
                                           {"mm", -3},
                                           {"um", -6},
                                           {"\u00b5m", -6},  // micro sign
                                           {"\u03bcm", -6},  // Greek mu
                                           {"nm", -9},
                                           {"pm", -12}}};

bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

// Length of the prefix of `text` that is [-]digits[.digits], with at least one digit; 0 if there is none.
size_t mantissa_size(std::string_view text) {
    size_t i = !text.empty() && text[0] == '-' ? 1 : 0;
    size_t n_digits = 0;
    for (; i < text.size() && is_digit(text[i]); ++i) ++n_digits;
    if (i < text.size() && text[i] == '.') {
        for (++i; i < text.size() && is_digit(text[i]); ++i) ++n_digits;
    }
    return n_digits ? i : 0;
}

// Length of the prefix e[+-]digits; 0 if there is none.
size_t exponent_size(std::string_view text) {
    if (text.empty() || (text[0] != 'e' && text[0] != 'E')) return 0;
    size_t i = text.size() > 1 && (text[1] == '-' || text[1] == '+') ? 2 : 1;
    const size_t first_digit = i;
    while (i < text.size() && is_digit(text[i])) ++i;
    return i > first_digit ? i : 0;
}

}  // namespace

const std::string& length_units_text() {
    static const std::string text = "km, m, cm, mm, um, nm, pm";
    return text;
}

double parse_length(std::string_view text, const std::string& field) {
    const std::string quoted = "\"" + std::string(text.substr(0, 60)) + "\"";
    const auto refuse = [&](ErrorCode code, const std::string& allowed) {
        throw Error(code, field, quoted,
                    allowed + ": a number and one of " + length_units_text() + ", as in \"5 mm\"");
    };
    const size_t n_mantissa = mantissa_size(text);
    if (n_mantissa == 0) refuse(ErrorCode::invalid_input, "not a length");
    const std::string mantissa(text.substr(0, n_mantissa));
    const size_t n_exponent = exponent_size(text.substr(n_mantissa));
    std::string_view exponent_text = text.substr(n_mantissa, n_exponent);
    std::string_view unit = text.substr(n_mantissa + n_exponent);
    while (!unit.empty() && unit.front() == ' ') unit.remove_prefix(1);
    if (unit.empty()) refuse(ErrorCode::missing_unit, "a length needs a unit");

    int exponent = 0;
    if (!exponent_text.empty()) {
        exponent_text.remove_prefix(exponent_text[1] == '+' ? 2 : 1);
        std::from_chars(exponent_text.data(), exponent_text.data() + exponent_text.size(), exponent);
        // An exponent that does not fit an int leaves 0, which would silently change the length.
        if (exponent == 0 && exponent_text.find_first_of("123456789") != std::string_view::npos) {
            refuse(ErrorCode::invalid_input, "out of range");
        }
    }
    for (const LengthUnit& known : units) {
        if (unit != known.name) continue;
        // The unit shifts the decimal exponent before the one rounding to double, so that "0.9 mm" and
        // "0.0009 m" are the same bits and give the same job hash; 0.9 * 1e-3 would round twice.
        const long long shifted = static_cast<long long>(exponent) + known.exponent;
        const std::string number = mantissa + "e" + std::to_string(shifted);
        double metres = 0;
        const auto result = std::from_chars(number.data(), number.data() + number.size(), metres);
        if (result.ec != std::errc() || result.ptr != number.data() + number.size() ||
            !std::isfinite(metres)) {
            refuse(ErrorCode::invalid_input, "out of range");
        }
        return metres + 0.0;  // -0 becomes 0
    }
    refuse(ErrorCode::invalid_input, "unknown unit");
    return 0;  // not reached
}

std::string format_length(double metres) {
    constexpr std::array<LengthUnit, 6> steps{
        {{"km", 3}, {"m", 0}, {"mm", -3}, {"um", -6}, {"nm", -9}, {"pm", -12}}};
    const double size = std::abs(metres);
    const LengthUnit* best = &steps[1];  // zero in metres
    for (size_t i = 0; size > 0 && i < steps.size(); ++i) {
        best = &steps[i];
        if (size >= 0.9999 * std::pow(10.0, best->exponent)) break;
    }
    char text[48];
    std::snprintf(text, sizeof text, "%.4g %s", metres * std::pow(10.0, -best->exponent), best->name.data());
    return text;
}

}  // namespace gonio
