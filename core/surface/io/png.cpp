// PNG by libpng: 8 and 16 bit grey, taken as linear numbers whatever gamma the file names.
#include <png.h>

#include <csetjmp>
#include <cstdint>
#include <memory>

#include "base/text.h"
#include "surface/io/formats.h"

namespace gonio {
namespace {

struct Input {
    std::string_view bytes;
    size_t position = 0;
    char message[128] = "";
};

void read_bytes(png_structp png, png_bytep target, size_t count) {
    auto& input = *static_cast<Input*>(png_get_io_ptr(png));
    if (count > input.bytes.size() - input.position) png_error(png, "truncated");
    std::memcpy(target, input.bytes.data() + input.position, count);
    input.position += count;
}

// libpng leaves its functions by longjmp, which skips destructors: the message goes to a plain array, and the
// functions that call setjmp (below) own nothing.
[[noreturn]] void on_error(png_structp png, png_const_charp message) {
    auto& input = *static_cast<Input*>(png_get_error_ptr(png));
    std::strncpy(input.message, message, sizeof input.message - 1);
    png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

bool read_header(png_structp png, png_infop info) {
    if (setjmp(png_jmpbuf(png))) return false;
    png_read_info(png, info);
    return true;
}

bool read_pixels(png_structp png, png_bytepp rows) {
    if (setjmp(png_jmpbuf(png))) return false;
    png_set_interlace_handling(png);
    png_read_image(png, rows);
    png_read_end(png, nullptr);
    return true;
}

struct Png {
    explicit Png(Input& input)
        : handle(png_create_read_struct(PNG_LIBPNG_VER_STRING, &input, on_error, ignore_warning)) {
        info = handle ? png_create_info_struct(handle) : nullptr;
        if (!info) {
            png_destroy_read_struct(&handle, nullptr, nullptr);
            throw std::bad_alloc();
        }
        png_set_read_fn(handle, &input, read_bytes);
    }
    ~Png() { png_destroy_read_struct(&handle, &info, nullptr); }
    Png(const Png&) = delete;
    Png& operator=(const Png&) = delete;
    png_structp handle;
    png_infop info = nullptr;
};

void check_pixel_type(const FileBytes& file, int colour, int bits, bool transparency_chunk) {
    if (colour == PNG_COLOR_TYPE_PALETTE)
        refuse(file, "palette", "a height map must be grey, 8 or 16 bits, not a palette");
    if (bits != 8 && bits != 16)
        refuse(file, std::to_string(bits) + " bits", "a height map must have 8 or 16 bits");
    if (transparency_chunk) refuse(file, "a transparent colour", "a height map must be opaque");
}

// The one height that a pixel of 1 to 4 channels stands for. size: bytes a sample; samples are big endian.
struct PixelReader {
    const FileBytes& file;
    int channels, size;

    unsigned sample(const unsigned char* pixel, int c) const {
        return size == 1 ? pixel[c] : static_cast<unsigned>(pixel[2 * c] << 8 | pixel[2 * c + 1]);
    }
    double height(const unsigned char* pixel, int i, int j) const {
        const unsigned value = sample(pixel, 0), opaque = size == 1 ? 255 : 65535;
        if (channels >= 3 && (sample(pixel, 1) != value || sample(pixel, 2) != value))
            refuse(file, place(i, j),
                   "the red, green and blue of a height map must be equal; if this is Terrain-RGB (height = "
                   "-10000 + 0.1 "
                   "(65536 R + 256 G + B) m), convert it to 16-bit grey, GSF or OpenEXR first");
        if (channels % 2 == 0 && sample(pixel, channels - 1) != opaque)
            refuse(file, place(i, j), "a height map must be opaque, this pixel is not");
        return value;
    }
    static std::string place(int i, int j) {
        return "column " + std::to_string(i) + ", row " + std::to_string(j);
    }
};

}  // namespace

RawHeights read_png(const FileBytes& file, const ReadLimits& limits) {
    if (file.bytes.size() < 8 || png_sig_cmp(reinterpret_cast<png_const_bytep>(file.bytes.data()), 0, 8) != 0)
        refuse(file, "", "is not a PNG: its signature is missing");
    Input input{file.bytes};
    const Png png(input);
    if (!read_header(png.handle, png.info)) refuse(file, "", std::string("damaged PNG: ") + input.message);

    const png_uint_32 nx = png_get_image_width(png.handle, png.info),
                      ny = png_get_image_height(png.handle, png.info);
    const int bits = png_get_bit_depth(png.handle, png.info),
              channels = png_get_channels(png.handle, png.info);
    check_pixel_type(file, png_get_color_type(png.handle, png.info), bits,
                     png_get_valid(png.handle, png.info, PNG_INFO_tRNS));
    constexpr double best_deflate_ratio = 1032;
    const int pixel_bytes = channels * bits / 8;
    check_extents(file, nx, ny, limits, pixel_bytes / best_deflate_ratio, file.bytes.size());

    const size_t row_bytes = static_cast<size_t>(nx) * pixel_bytes;
    std::vector<unsigned char> pixels(row_bytes * ny);
    std::vector<png_bytep> rows(ny);
    for (size_t j = 0; j < ny; ++j) rows[j] = &pixels[j * row_bytes];
    if (!read_pixels(png.handle, rows.data())) refuse(file, "", std::string("damaged PNG: ") + input.message);

    RawHeights heights;
    heights.nx = static_cast<int>(nx), heights.ny = static_cast<int>(ny);
    heights.row0_at_top = true;
    heights.bits = bits;
    heights.integer_max = bits == 8 ? 255 : 65535;
    heights.values.reserve(static_cast<size_t>(nx) * ny);
    const PixelReader reader{file, channels, bits / 8};
    for (int j = 0; j < heights.ny; ++j)
        for (int i = 0; i < heights.nx; ++i)
            heights.values.push_back(reader.height(rows[j] + static_cast<size_t>(i) * pixel_bytes, i, j));

    // Many writers put a screen's 72 dpi here, so it is never taken for the surface's pitch.
    png_uint_32 per_unit_x = 0, per_unit_y = 0;
    int unit = 0;
    if (png_get_pHYs(png.handle, png.info, &per_unit_x, &per_unit_y, &unit) && unit == PNG_RESOLUTION_METER)
        heights.notes.push_back("the PNG carries " + std::to_string(per_unit_x) + " x " +
                                std::to_string(per_unit_y) +
                                " pixels per metre, ignored: often a screen's resolution");
    return heights;
}

}  // namespace gonio
