// NumPy .npy versions 1 to 3: "\x93NUMPY", version, length of the header, the header as a Python dictionary,
// the array.
#include <cmath>
#include <cstdint>

#include "surface/io/formats.h"

namespace gonio {
namespace {

struct Header {
    std::string type;  // kind and size without the byte order: "f8", "u2", ...
    bool big_endian = false, fortran_order = false;
    long long rows = 0, columns = 0;
};

// What follows 'key': in the dictionary, from the first character that is no blank.
std::string_view entry(const FileBytes& file, std::string_view dictionary, std::string_view key) {
    for (const char quote : {'\'', '"'}) {
        const std::string quoted = quote + std::string(key) + quote;
        if (const size_t at = dictionary.find(quoted); at != std::string_view::npos) {
            const std::string_view rest = trimmed(dictionary.substr(at + quoted.size()));
            if (rest.starts_with(':')) return trimmed(rest.substr(1));
        }
    }
    refuse(file, "", "the header has no '" + std::string(key) + "'");
}

Header parse_header(const FileBytes& file, std::string_view dictionary) {
    Header header;
    const std::string_view type = entry(file, dictionary, "descr");
    const std::string quoted(type.substr(0, std::min(type.find_first_of(",}"), type.size())));
    const std::string_view descr = trimmed(quoted);
    if (descr.size() != 5 || (descr[0] != '\'' && descr[0] != '"') ||
        std::string_view("<>|=").find(descr[1]) == std::string_view::npos)
        refuse(file, quoted, "dtype must be a plain number type such as '<f4'");
    header.big_endian = descr[1] == '>';
    header.type = descr.substr(2, 2);
    header.fortran_order = entry(file, dictionary, "fortran_order").starts_with("True");

    std::string_view shape = entry(file, dictionary, "shape");
    const size_t close = shape.find(')'), comma = shape.find(',');
    if (!shape.starts_with('(') || close == std::string_view::npos || comma >= close)
        refuse(file, std::string(shape.substr(0, 40)), "shape must be a tuple (rows, columns)");
    const auto rows = parse_integer(trimmed(shape.substr(1, comma - 1)));
    const auto columns = parse_integer(trimmed(shape.substr(comma + 1, close - comma - 1)));
    if (!rows || !columns)
        refuse(file, std::string(shape.substr(0, close + 1)), "the array must be 2-D: (rows, columns)");
    header.rows = *rows, header.columns = *columns;
    return header;
}

double half_value(const char* data, bool big_endian) {
    const int bits = load<uint16_t>(data, big_endian), exponent = bits >> 10 & 31, mantissa = bits & 1023;
    const double sign = bits & 0x8000 ? -1 : 1;
    if (exponent == 31) return mantissa ? std::nan("") : sign * INFINITY;
    return sign * (exponent ? std::ldexp(1024 + mantissa, exponent - 25) : std::ldexp(mantissa, -24));
}

template <class T>
double value_of(const char* data, bool big_endian) {
    return static_cast<double>(load<T>(data, big_endian));
}

using ValueOf = double (*)(const char*, bool);

ValueOf reader_of(const FileBytes& file, const std::string& type) {
    constexpr std::pair<std::string_view, ValueOf> types[] = {
        {"f2", half_value},         {"f4", value_of<float>},    {"f8", value_of<double>},
        {"i1", value_of<int8_t>},   {"i2", value_of<int16_t>},  {"i4", value_of<int32_t>},
        {"i8", value_of<int64_t>},  {"u1", value_of<uint8_t>},  {"u2", value_of<uint16_t>},
        {"u4", value_of<uint32_t>}, {"u8", value_of<uint64_t>},
    };
    for (const auto& [name, function] : types)
        if (name == type) return function;
    refuse(file, type, "dtype must be one of f2 f4 f8 i1 i2 i4 i8 u1 u2 u4 u8");
}

}  // namespace

RawHeights read_npy(const FileBytes& file, const ReadLimits& limits) {
    const std::string_view bytes = file.bytes;
    if (!bytes.starts_with("\x93NUMPY") || bytes.size() < 12)
        refuse(file, "", "is not a NumPy .npy file: its first bytes are wrong");
    const int version = static_cast<unsigned char>(bytes[6]);
    if (version < 1 || version > 3)
        refuse(file, "version " + std::to_string(version), "versions 1 to 3 are read");
    const size_t start = version == 1 ? 10 : 12;
    const size_t length = version == 1 ? load<uint16_t>(&bytes[8], false) : load<uint32_t>(&bytes[8], false);
    if (length > bytes.size() - start) refuse(file, "", "the header is longer than the file: truncated");
    const Header header = parse_header(file, bytes.substr(start, length));

    const std::string_view data = bytes.substr(start + length);
    const size_t size = header.type[1] - '0';
    const ValueOf value = reader_of(file, header.type);
    check_extents(file, header.columns, header.rows, limits, static_cast<double>(size), data.size());
    if (data.size() != static_cast<size_t>(header.rows) * header.columns * size)
        refuse(file, std::to_string(data.size()) + " bytes of data",
               "the shape and dtype take " +
                   std::to_string(header.rows * header.columns * static_cast<long long>(size)) + " bytes");

    RawHeights heights;
    heights.nx = static_cast<int>(header.columns), heights.ny = static_cast<int>(header.rows);
    if (header.type[0] == 'u' && size <= 2) {
        heights.bits = static_cast<int>(8 * size);
        heights.integer_max = size == 1 ? 255 : 65535;
    }
    const size_t column_stride = size * (header.fortran_order ? header.rows : 1);
    const size_t row_stride = size * (header.fortran_order ? 1 : header.columns);
    heights.values.reserve(static_cast<size_t>(header.rows) * header.columns);
    for (int j = 0; j < heights.ny; ++j)
        for (int i = 0; i < heights.nx; ++i)
            heights.values.push_back(value(&data[j * row_stride + i * column_stride], header.big_endian));
    return heights;
}

}  // namespace gonio
