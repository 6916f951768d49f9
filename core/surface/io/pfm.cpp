// Portable float map: "Pf", width height, scale (its sign is the byte order: negative is little endian), one
// blank, float32 rows from the BOTTOM up.
#include <cmath>

#include "base/text.h"
#include "surface/io/formats.h"

namespace gonio {
namespace {

std::string_view next_token(std::string_view bytes, size_t& position) {
    constexpr std::string_view blank = " \t\r\n";
    const size_t first = std::min(bytes.find_first_not_of(blank, position), bytes.size());
    position = std::min(bytes.find_first_of(blank, first), bytes.size());
    return bytes.substr(first, position - first);
}

}  // namespace

RawHeights read_pfm(const FileBytes& file, const ReadLimits& limits) {
    size_t position = 0;
    const std::string_view magic = next_token(file.bytes, position);
    if (magic == "PF") refuse(file, "PF", "is a colour PFM; heights need a grey one (Pf)");
    if (magic != "Pf") refuse(file, "", "is not a PFM: it must start with Pf");
    const auto nx = parse_integer(next_token(file.bytes, position)),
               ny = parse_integer(next_token(file.bytes, position));
    if (!nx || !ny) refuse(file, "", "width and height must be integers");
    const auto scale = parse_number(next_token(file.bytes, position));
    if (!scale || !std::isfinite(*scale) || *scale == 0)
        refuse(file, "", "the scale must be a number other than 0");
    const std::string_view data = file.bytes.substr(std::min(position + 1, file.bytes.size()));
    check_extents(file, *nx, *ny, limits, 4, data.size());
    if (data.size() != static_cast<size_t>(*nx) * *ny * 4)
        refuse(file, std::to_string(data.size()) + " bytes of data",
               "width x height values take " + std::to_string(*nx * *ny * 4) + " bytes");

    RawHeights heights;
    heights.nx = static_cast<int>(*nx), heights.ny = static_cast<int>(*ny);
    heights.values.reserve(static_cast<size_t>(*nx) * *ny);
    for (size_t k = 0; k < data.size(); k += 4) heights.values.push_back(load<float>(&data[k], *scale > 0));
    if (std::abs(*scale) != 1)
        heights.notes.push_back("the PFM's scale " + number_text(std::abs(*scale)) +
                                " is ignored: it names no unit");
    return heights;
}

}  // namespace gonio
