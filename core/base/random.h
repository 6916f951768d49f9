// Counter-based random numbers: a pure function of (seed, stream, counter), so that any thread, shard or
// machine draws the same numbers for the same work. Philox 4x32-10 of Salmon et al. 2011, "Parallel random
// numbers: as easy as 1, 2, 3".
#pragma once
#include <Random123/philox.h>

#include <array>
#include <cstdint>

namespace gonio {

// Four independent uniform words.
inline std::array<uint32_t, 4> random_words(uint64_t seed, uint64_t stream, uint64_t counter) {
    const r123::Philox4x32 philox;
    const auto words = philox({{static_cast<uint32_t>(counter), static_cast<uint32_t>(counter >> 32),
                                static_cast<uint32_t>(stream), static_cast<uint32_t>(stream >> 32)}},
                              {{static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32)}});
    return {words[0], words[1], words[2], words[3]};
}

// Uniform double in [0, 1) with 32 bits, and float in [0, 1) with 24 bits (never 1 after rounding).
inline double uniform_double(uint32_t word) {
    return word * 0x1p-32;
}
inline float uniform_float(uint32_t word) {
    return static_cast<float>(word >> 8) * 0x1p-24f;
}

}  // namespace gonio
