#include "surface/io/height_reader.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>

#include "surface/io/formats.h"

namespace gonio {
namespace {

using namespace std::string_view_literals;

struct Format {
    std::string_view name;
    std::string_view signature;   // the file's first bytes; empty: none
    std::string_view extensions;  // " .a .b " (lower case)
    RawHeights (*read)(const FileBytes&, const ReadLimits&);
};

constexpr std::array<Format, 6> formats{{
    {"gsf", "Gwyddion Simple Field 1.0\n"sv, " .gsf ", read_gsf},
    {"png", "\x89PNG\r\n\x1a\n"sv, " .png ", read_png},
    {"exr", "\x76\x2f\x31\x01"sv, " .exr ", read_exr},
    {"npy", "\x93NUMPY"sv, " .npy ", read_npy},
    {"pfm", "Pf\n"sv, " .pfm ", read_pfm},
    {"text", ""sv, " .txt .csv .tsv .dat .asc ", read_text_matrix},
}};

// A file without an extension (the service names surfaces by their hash) can be a text matrix if it begins as
// text.
bool is_text(std::string_view bytes) {
    const std::string_view head = bytes.substr(0, 4096);
    return !head.empty() && std::all_of(head.begin(), head.end(), [](unsigned char c) {
        return (c >= ' ' && c != 0x7f) || c == '\t' || c == '\n' || c == '\r';
    });
}

const Format* find_format(const FileBytes& file) {
    for (const Format& format : formats)
        if (!format.signature.empty() && file.bytes.starts_with(format.signature)) return &format;
    std::string extension = std::filesystem::path(file.name).extension().string();
    for (char& c : extension)
        if (c >= 'A' && c <= 'Z') c += 'a' - 'A';
    if (extension.empty()) return is_text(file.bytes) ? &formats.back() : nullptr;
    for (const Format& format : formats)
        if (format.extensions.find(" " + extension + " ") != std::string_view::npos) return &format;
    return nullptr;
}

}  // namespace

void check_extents(const FileBytes& file, long long nx, long long ny, const ReadLimits& limits,
                   double least_bytes, size_t available) {
    const std::string found = std::to_string(nx) + " x " + std::to_string(ny) + " points";
    constexpr long long max_side = 1LL << 30;
    if (nx < 1 || ny < 1 || nx > max_side || ny > max_side)
        refuse(file, found, "needs at least 1 x 1 points");
    if (nx * ny > limits.max_points)
        throw Error(ErrorCode::limit, file.name, found,
                    "more than the configured limit of " + std::to_string(limits.max_points) + " points");
    if (static_cast<double>(nx * ny) * least_bytes > static_cast<double>(available))
        refuse(file, found,
               "more than the " + std::to_string(available) +
                   " bytes of data in the file can hold: truncated or damaged");
}

std::optional<double> parse_number(std::string_view text) {
    if (text.starts_with('+')) {  // which from_chars does not take
        text.remove_prefix(1);
        if (text.starts_with('-')) return std::nullopt;
    }
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

std::optional<long long> parse_integer(std::string_view text) {
    long long value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

RawHeights decode_heights(const FileBytes& file, const ReadLimits& limits) {
    const Format* format = find_format(file);
    if (!format)
        refuse(
            file, "",
            "neither the content nor the extension is known; height fields are read from GSF, PNG, OpenEXR, "
            "NumPy .npy, PFM and text (.txt .csv .tsv .dat .asc)");
    RawHeights heights = format->read(file, limits);
    heights.format = format->name;
    return heights;
}

std::string read_bytes(const std::string& path, const ReadLimits& limits) {
    std::error_code failure;
    if (!std::filesystem::exists(path, failure))
        throw Error(ErrorCode::not_found, path, "", "there is no such file");
    if (!std::filesystem::is_regular_file(path, failure))
        throw Error(ErrorCode::io, path, "", "is not a regular file");
    const auto size = std::filesystem::file_size(path, failure);
    if (failure) throw Error(ErrorCode::io, path, "", "cannot be read: " + failure.message());
    if (size > static_cast<unsigned long long>(limits.max_bytes))
        throw Error(ErrorCode::limit, path, std::to_string(size) + " bytes",
                    "more than the configured limit of " + std::to_string(limits.max_bytes) + " bytes");
    std::string bytes(size, '\0');
    std::ifstream stream(path, std::ios::binary);
    if (!stream.read(bytes.data(), static_cast<std::streamsize>(size)))
        throw Error(ErrorCode::io, path, "", "cannot be read");
    return bytes;
}

RawHeights read_heights(const std::string& path, const ReadLimits& limits) {
    return decode_heights({path, read_bytes(path, limits)}, limits);
}

}  // namespace gonio
