// Gwyddion Simple Field 1.0: text header, 1 to 4 NULs up to a multiple of 4, then float32 little endian, rows
// from the top.
#include <cmath>
#include <map>

#include "base/units.h"
#include "surface/io/formats.h"

namespace gonio {
namespace {

using Header = std::map<std::string, std::string, std::less<>>;

Header parse_header(const FileBytes& file, std::string_view text) {
    Header header;
    while (!text.empty()) {
        const size_t end = std::min(text.find('\n'), text.size());
        const std::string_view line = trimmed(text.substr(0, end));
        text.remove_prefix(std::min(end + 1, text.size()));
        if (line.empty()) continue;
        const size_t equals = line.find('=');
        if (equals == std::string_view::npos)
            refuse(file, std::string(line.substr(0, 80)), "header lines are 'Name = value'");
        header[std::string(trimmed(line.substr(0, equals)))] = trimmed(line.substr(equals + 1));
    }
    return header;
}

long long resolution(const FileBytes& file, const Header& header, std::string_view name) {
    const auto entry = header.find(name);
    const auto value = entry == header.end() ? std::nullopt : parse_integer(entry->second);
    if (!value)
        refuse(file, entry == header.end() ? "" : entry->second, std::string(name) + " must be an integer");
    return *value;
}

// Metres per unit named by `key`. Base units have no default here although Gwyddion assumes one: nothing
// defaults to 1 silently.
std::optional<double> unit(const Header& header, std::string_view key, RawHeights& heights) {
    const auto entry = header.find(key);
    if (entry == header.end()) return std::nullopt;
    const auto metres = metres_per(entry->second);
    if (!metres)
        heights.notes.push_back(std::string(key) + " = '" + entry->second +
                                "' is no length that gonio knows, ignored");
    return metres;
}

// XReal (YReal) is the WHOLE width: the pitch is XReal / XRes.
std::optional<double> pitch(const Header& header, std::string_view key, int n, std::optional<double> metres) {
    const auto entry = header.find(key);
    if (entry == header.end() || !metres) return std::nullopt;
    const auto extent = parse_number(entry->second);
    return extent && std::isfinite(*extent) && *extent > 0 ? std::optional(*extent * *metres / n)
                                                           : std::nullopt;
}

}  // namespace

RawHeights read_gsf(const FileBytes& file, const ReadLimits& limits) {
    constexpr std::string_view magic = "Gwyddion Simple Field 1.0\n";
    if (!file.bytes.starts_with(magic))
        refuse(file, "", "is not a Gwyddion Simple Field 1.0: its first line is missing");
    const size_t nul = file.bytes.find('\0');
    if (nul == std::string_view::npos) refuse(file, "", "the NUL that ends the header is missing: truncated");
    const Header header = parse_header(file, file.bytes.substr(magic.size(), nul - magic.size()));
    const std::string_view data = file.bytes.substr(std::min(nul + 4 - nul % 4, file.bytes.size()));

    const long long nx = resolution(file, header, "XRes"), ny = resolution(file, header, "YRes");
    check_extents(file, nx, ny, limits, 4, data.size());
    if (data.size() != static_cast<size_t>(nx) * ny * 4)
        refuse(file, std::to_string(data.size()) + " bytes of data",
               std::to_string(nx) + " x " + std::to_string(ny) + " heights take " +
                   std::to_string(nx * ny * 4) + " bytes");

    RawHeights heights;
    heights.nx = static_cast<int>(nx), heights.ny = static_cast<int>(ny);
    heights.row0_at_top = true;
    heights.values.reserve(static_cast<size_t>(nx) * ny);
    for (size_t k = 0; k < data.size(); k += 4) heights.values.push_back(load<float>(&data[k], false));
    const auto lateral = unit(header, "XYUnits", heights);
    heights.pitch_x = pitch(header, "XReal", heights.nx, lateral);
    heights.pitch_y = pitch(header, "YReal", heights.ny, lateral);
    heights.height_unit = unit(header, "ZUnits", heights);
    return heights;
}

}  // namespace gonio
