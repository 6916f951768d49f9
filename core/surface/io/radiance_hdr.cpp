// The picture format of Radiance (Ward 1991, "Real Pixels"; color.c, resolu.c of Radiance): text lines up to
// an empty one, a line "-Y rows +X columns", and rows of pixels of four bytes: red, green, blue mantissas and
// their common exponent, value = (mantissa + 1/2) 2^(exponent - 136), 0 where the exponent is 0. Rows of 8 to
// 32767 pixels may be run-length coded, byte by byte.
#include <cmath>

#include "surface/io/radiance_image.h"

namespace gonio {
namespace {

class Bytes {
  public:
    Bytes(const FileBytes& file, size_t position) : file_(file), position_(position) {}
    unsigned char next() {
        if (position_ >= file_.bytes.size()) refuse(file_, "", "damaged Radiance picture: it is cut off");
        return static_cast<unsigned char>(file_.bytes[position_++]);
    }
    // Whether the next row of `width` pixels says that it is run-length coded.
    bool coded_row(int width) const {
        const auto at = [&](size_t k) {
            return position_ + k < file_.bytes.size() ? static_cast<unsigned char>(file_.bytes[position_ + k])
                                                      : 0;
        };
        return width >= 8 && width <= 32767 && at(0) == 2 && at(1) == 2 && at(2) == width / 256 &&
               at(3) == width % 256;
    }

  private:
    const FileBytes& file_;
    size_t position_;
};

std::string_view next_line(const FileBytes& file, size_t& position) {
    const size_t end = file.bytes.find('\n', position);
    if (end == std::string_view::npos) refuse(file, "", "damaged Radiance picture: its header has no end");
    std::string_view line = file.bytes.substr(position, end - position);
    position = end + 1;
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
}

struct Size {
    long long nx = 0, ny = 0;
};

// "-Y 512 +X 1024": rows from the top down, columns from left to right. The other seven orders are not in
// use.
Size parse_size(const FileBytes& file, std::string_view line) {
    const size_t columns = line.find(" +X ");
    if (line.starts_with("-Y ") && columns != std::string_view::npos) {
        const auto ny = parse_integer(trimmed(line.substr(3, columns - 3))),
                   nx = parse_integer(trimmed(line.substr(columns + 4)));
        if (nx && ny) return {*nx, *ny};
    }
    refuse(file, std::string(line.substr(0, 60)), "the size must be written as \"-Y rows +X columns\"");
}

// rgbe[4 * column + component].
void read_row(const FileBytes& file, Bytes& bytes, std::vector<unsigned char>& rgbe) {
    const int width = static_cast<int>(rgbe.size() / 4);
    if (!bytes.coded_row(width)) {
        for (unsigned char& byte : rgbe) byte = bytes.next();
        return;
    }
    for (int k = 0; k < 4; ++k) bytes.next();
    for (int component = 0; component < 4; ++component)
        for (int column = 0; column < width;) {
            int run = bytes.next();
            const bool same = run > 128;
            if (same) run -= 128;
            if (run == 0 || column + run > width)
                refuse(file, "", "damaged Radiance picture: a run does not fit its row");
            unsigned char value = same ? bytes.next() : 0;
            for (int k = 0; k < run; ++k) {
                if (!same) value = bytes.next();
                rgbe[4 * static_cast<size_t>(column++) + component] = value;
            }
        }
}

}  // namespace

RadianceImage read_radiance_hdr(const FileBytes& file, const ReadLimits& limits) {
    size_t position = 0;
    double exposure = 1;
    for (std::string_view line = next_line(file, position); !line.empty(); line = next_line(file, position)) {
        if (line.starts_with("FORMAT=") && line != "FORMAT=32-bit_rle_rgbe")
            refuse(file, std::string(line.substr(0, 60)), "only 32-bit_rle_rgbe is read (no XYZE)");
        if (line.starts_with("EXPOSURE=")) {  // what the radiances were multiplied by; every line counts
            const auto factor = parse_number(trimmed(line.substr(9)));
            if (!factor || !std::isfinite(*factor) || !(*factor > 0))
                refuse(file, std::string(line.substr(0, 60)), "the exposure must be a number above 0");
            exposure *= *factor;
        }
    }
    const Size size = parse_size(file, next_line(file, position));
    // The best run: 127 pixels of one component in two bytes.
    check_extents(file, size.nx, size.ny, limits, 4 * 2.0 / 127, file.bytes.size() - position);

    RadianceImage image{static_cast<int>(size.nx), static_cast<int>(size.ny), 3, {}};
    const size_t plane = static_cast<size_t>(image.nx) * image.ny;
    image.values.resize(3 * plane);
    std::vector<unsigned char> rgbe(4 * static_cast<size_t>(image.nx));
    Bytes bytes(file, position);
    for (int row = 0; row < image.ny; ++row) {
        read_row(file, bytes, rgbe);
        for (int column = 0; column < image.nx; ++column) {
            const unsigned char* pixel = &rgbe[4 * static_cast<size_t>(column)];
            if (pixel[3] == 0) continue;
            const double unit = std::ldexp(1 / exposure, pixel[3] - 136);
            for (int c = 0; c < 3; ++c)
                image.values[c * plane + static_cast<size_t>(row) * image.nx + column] =
                    static_cast<float>((pixel[c] + 0.5) * unit);
        }
    }
    return image;
}

}  // namespace gonio
