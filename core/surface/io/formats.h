// What the readers share, and their list. A reader sees the bytes of a whole file and throws
// Error(invalid_input, limit) naming the file; it never trusts an extent before check_extents has. A new
// format: one file here, one declaration below, one line in height_reader.cpp.
#pragma once
#include <bit>
#include <concepts>
#include <cstring>
#include <string>
#include <string_view>

#include "base/error.h"
#include "surface/io/height_reader.h"

namespace gonio {

struct FileBytes {
    std::string name;  // for messages, and for the extension
    std::string_view bytes;
};

RawHeights read_gsf(const FileBytes& file, const ReadLimits& limits);
RawHeights read_png(const FileBytes& file, const ReadLimits& limits);
RawHeights read_exr(const FileBytes& file, const ReadLimits& limits);
RawHeights read_npy(const FileBytes& file, const ReadLimits& limits);
RawHeights read_pfm(const FileBytes& file, const ReadLimits& limits);
RawHeights read_text_matrix(const FileBytes& file, const ReadLimits& limits);

// read_heights after the file is in memory (what the fuzzer feeds).
RawHeights decode_heights(const FileBytes& file, const ReadLimits& limits);

// A whole file in memory. Throws Error (not_found, io, limit).
std::string read_bytes(const std::string& path, const ReadLimits& limits);

[[noreturn]] inline void refuse(const FileBytes& file, const std::string& found, const std::string& allowed) {
    throw Error(ErrorCode::invalid_input, file.name, found, allowed);
}

// Throws unless 1 <= nx, ny, nx * ny <= limits.max_points, and the values could come out of `available` bytes
// at `least_bytes` each (below 1 for compressed formats: their best ratio).
void check_extents(const FileBytes& file, long long nx, long long ny, const ReadLimits& limits,
                   double least_bytes, size_t available);

// The number at `data` in either byte order. T: any arithmetic type; data: sizeof(T) bytes, unaligned.
template <class T>
T load(const char* data, bool big_endian) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, data, sizeof(T));
    if (big_endian == (std::endian::native == std::endian::little))
        for (size_t k = 0; k < sizeof(T) / 2; ++k) std::swap(bytes[k], bytes[sizeof(T) - 1 - k]);
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
}

inline std::string_view trimmed(std::string_view text) {
    constexpr std::string_view blank = " \t\r\n\v\f";
    const size_t first = text.find_first_not_of(blank);
    return first == std::string_view::npos ? std::string_view()
                                           : text.substr(first, text.find_last_not_of(blank) - first + 1);
}

// The whole of `text` as a number (a leading + and nan are allowed); nothing if it is not one or does not fit
// its type.
std::optional<double> parse_number(std::string_view text);
std::optional<long long> parse_integer(std::string_view text);

}  // namespace gonio
