// Half-precision floats as the 16 bits that files hold. The conversions are Imath's, to the nearest and even.
#pragma once
#define IMATH_HALF_NO_LOOKUP_TABLE  // a table would have to be linked
#include <Imath/half.h>

#include <cstdint>

namespace gonio {

inline uint16_t half_bits(float value) {
    return imath_float_to_half(value);
}
inline float from_half_bits(uint16_t bits) {
    return imath_half_to_float(bits);
}

}  // namespace gonio
