// Bit matrices.
#pragma once
#include <cstdint>

namespace gonio {

// Transposes a 32 x 32 bit matrix in place, bit c of row r <-> bit r of row c (Warren, Hacker's Delight,
// 7-3).
inline void transpose_bits(uint32_t a[32]) {
    uint32_t mask = 0x0000ffff;
    for (int j = 16; j != 0; j >>= 1, mask ^= mask << j)
        for (int k = 0; k < 32; k = (k + j + 1) & ~j) {
            const uint32_t t = ((a[k] >> j) ^ a[k + j]) & mask;
            a[k] ^= t << j;
            a[k + j] ^= t;
        }
}

}  // namespace gonio
