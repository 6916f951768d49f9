// Guarded primitives, written once.
#pragma once
#include <algorithm>
#include <cmath>
#include <numbers>

namespace gonio {

inline constexpr double pi = std::numbers::pi;
inline constexpr double radians(double degrees) {
    return degrees * (pi / 180);
}
inline constexpr double degrees(double radians) {
    return radians * (180 / pi);
}
inline double safe_sqrt(double x) {
    return std::sqrt(std::max(0.0, x));
}
inline double safe_acos(double x) {
    return std::acos(std::clamp(x, -1.0, 1.0));
}
inline double fractional_part(double x) {
    return x - std::floor(x);
}

// i modulo n in [0, n), for any i.
inline int wrap_index(long long i, int n) {
    const long long r = i % n;
    return static_cast<int>(r < 0 ? r + n : r);
}

}  // namespace gonio
