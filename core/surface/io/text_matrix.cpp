// Matrices as text: one row a line, separated by blanks, commas or semicolons (an empty field between two of
// these is a missing point), bare or with the '#' lines of a Gwyddion export:
//   # Channel: ZSensor / # Width: 10.00 um / # Height: 10.00 um / # Value units: m
// Width and Height are the lateral extents of the whole matrix.
#include <cmath>
#include <limits>

#include "base/units.h"
#include "surface/io/formats.h"

namespace gonio {
namespace {

struct Lines {
    std::string_view rest;
    long long number = 0;  // of the line that next() gave, from 1
    bool next(std::string_view& line) {
        if (rest.empty()) return false;
        const size_t end = std::min(rest.find('\n'), rest.size());
        line = trimmed_ends(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
        ++number;
        return true;
    }
    // Without the line's end but with its tabs and commas at both ends.
    static std::string_view trimmed_ends(std::string_view line) {
        while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
        return line;
    }
};

struct Metadata {
    std::optional<double> width, depth, height_unit;  // metres
};

// "10.00 um" in metres.
std::optional<double> length(std::string_view text) {
    const size_t blank = text.find(' ');
    if (blank == std::string_view::npos) return std::nullopt;
    const auto number = parse_number(text.substr(0, blank));
    const auto unit = metres_per(trimmed(text.substr(blank)));
    return number && unit && std::isfinite(*number) && *number > 0 ? std::optional(*number * *unit)
                                                                   : std::nullopt;
}

void parse_comment(std::string_view line, Metadata& metadata, RawHeights& heights) {
    const size_t colon = line.find(':');
    if (colon == std::string_view::npos) return;
    const std::string_view key = trimmed(line.substr(1, colon - 1)), value = trimmed(line.substr(colon + 1));
    std::optional<double>* target = key == "Width"         ? &metadata.width
                                    : key == "Height"      ? &metadata.depth
                                    : key == "Value units" ? &metadata.height_unit
                                                           : nullptr;
    if (!target) return;
    *target = key == "Value units" ? metres_per(value) : length(value);
    if (!*target)
        heights.notes.push_back(std::string(key) + ": '" + std::string(value) +
                                "' is no length that gonio knows, ignored");
}

// Appends the numbers of one line; returns how many.
size_t parse_row(const FileBytes& file, const Lines& lines, std::string_view line,
                 std::vector<double>& values) {
    const bool commas = line.find(',') != std::string_view::npos,
               semicolons = line.find(';') != std::string_view::npos;
    if (commas && (semicolons || line.find('\t') != std::string_view::npos))
        refuse(file, "line " + std::to_string(lines.number),
               "mixes ',' with ';' or tabs; decimal commas are not read, write decimal points");
    const char separator = commas ? ',' : semicolons ? ';' : '\0';
    const size_t before = values.size();
    while (true) {
        if (!separator) line = trimmed(line);
        if (line.empty()) break;
        const size_t end =
            std::min(separator ? line.find(separator) : line.find_first_of(" \t\v\f"), line.size());
        const std::string_view field = trimmed(line.substr(0, end));
        const auto number = field.empty() ? std::numeric_limits<double>::quiet_NaN() : parse_number(field);
        if (!number)
            refuse(file,
                   "'" + std::string(field.substr(0, 40)) + "' in line " + std::to_string(lines.number) +
                       ", field " + std::to_string(values.size() - before + 1),
                   "is not a number");
        values.push_back(*number);
        line.remove_prefix(std::min(end + 1, line.size()));
    }
    return values.size() - before;
}

}  // namespace

RawHeights read_text_matrix(const FileBytes& file, const ReadLimits& limits) {
    if (file.bytes.find('\0') != std::string_view::npos)
        refuse(file, "", "is not text: it contains NUL bytes");
    RawHeights heights;
    Metadata metadata;
    Lines lines{file.bytes};
    if (lines.rest.starts_with("\xef\xbb\xbf")) lines.rest.remove_prefix(3);
    size_t nx = 0, ny = 0;
    for (std::string_view line; lines.next(line);) {
        if (trimmed(line).empty()) continue;
        if (line.starts_with('#')) {
            parse_comment(line, metadata, heights);
            continue;
        }
        const size_t count = parse_row(file, lines, line, heights.values);
        if (ny == 0) nx = count;
        if (count != nx)
            refuse(file, std::to_string(count) + " numbers in line " + std::to_string(lines.number),
                   "every row must have as many as the first, " + std::to_string(nx));
        ++ny;
        check_extents(file, static_cast<long long>(nx), static_cast<long long>(ny), limits, 1,
                      file.bytes.size());
    }
    if (ny == 0) refuse(file, "", "holds no numbers");
    heights.nx = static_cast<int>(nx), heights.ny = static_cast<int>(ny);
    if (metadata.width) heights.pitch_x = *metadata.width / heights.nx;
    if (metadata.depth) heights.pitch_y = *metadata.depth / heights.ny;
    heights.height_unit = metadata.height_unit;
    return heights;
}

}  // namespace gonio
