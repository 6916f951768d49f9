#include "clients/plot/axis.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace gonio {
namespace {

// The step of 1, 2 or 5 times a power of ten nearest above `rough`.
double nice_step(double rough) {
    const double power = std::pow(10, std::floor(std::log10(rough)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= rough * (1 - 1e-9)) return factor * power;
    return 10 * power;
}

}  // namespace

double Scale::place(double value) const {
    if (!is_log) return (value - low) / (high - low);
    return value > 0 ? std::log(value / low) / std::log(high / low) : 0;
}

std::vector<double> ticks(const Scale& scale, int count) {
    std::vector<double> values;
    const double slack = 1e-9;
    if (!scale.is_log ||
        scale.high < 5 * scale.low) {  // a short stretch of a logarithm has few powers of ten
        const double step = nice_step((scale.high - scale.low) / count);
        for (double k = std::ceil(scale.low / step - slack); k * step <= scale.high + slack * step; ++k)
            values.push_back(k * step);
        return values;
    }
    const double decades = std::log10(scale.high / scale.low);
    const int stride = std::max(1, static_cast<int>(std::ceil(decades / count)));
    for (int e = static_cast<int>(std::floor(std::log10(scale.low)));
         std::pow(10, e) <= scale.high * (1 + slack); e += stride) {
        for (const double factor : {1.0, 2.0, 5.0}) {
            if (factor > 1 && decades > 0.5 * count) break;
            const double value = factor * std::pow(10, e);
            if (value >= scale.low * (1 - slack) && value <= scale.high * (1 + slack))
                values.push_back(value);
        }
    }
    return values;
}

std::string tick_label(double value) {
    if (value == 0) return "0";
    const double size = std::abs(value);
    if (size >= 1e-3 && size < 1e4) return number_text(value, 4);
    const int exponent = static_cast<int>(std::floor(std::log10(size) + 1e-9));
    const double mantissa = value / std::pow(10, exponent);
    static const char* raised[] = {"\u2070", "\u00b9", "\u00b2", "\u00b3", "\u2074",
                                   "\u2075", "\u2076", "\u2077", "\u2078", "\u2079"};
    std::string text = std::abs(mantissa - 1) < 1e-6 ? "10" : number_text(mantissa, 3) + "\u00b710";
    for (const char digit : std::to_string(exponent)) text += digit == '-' ? "\u207b" : raised[digit - '0'];
    return text;
}

Scale enclosing_scale(double low, double high, bool is_log, int count) {
    if (is_log) {
        if (high / low < 1.5) low /= 1.5, high *= 1.5;
        const double slack = 1e-9;
        return {std::pow(10, std::floor(std::log10(low) + slack)),
                std::pow(10, std::ceil(std::log10(high) - slack)), true};
    }
    if (high - low <= 1e-6 * std::max(std::abs(low), std::abs(high))) {
        const double pad = high != 0 ? 0.1 * std::abs(high) : 1;
        low -= pad, high += pad;
    }
    const double step = nice_step((high - low) / count);
    return {std::floor(low / step + 1e-9) * step, std::ceil(high / step - 1e-9) * step, false};
}

}  // namespace gonio
