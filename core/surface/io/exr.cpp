// OpenEXR, one flat part. Heights in the first of the channels Y, Z, height, R, or in the only one; pitch and
// unit in the attributes pixelPitchX_m, pixelPitchY_m and heightUnit_m (number, or text).
#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFloatAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfStringAttribute.h>
#include <ImfTileDescription.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/units.h"
#include "surface/io/formats.h"
#include "surface/io/radiance_image.h"

namespace gonio {
namespace {

class MemoryStream : public Imf::IStream {
  public:
    explicit MemoryStream(const FileBytes& file) : IStream(file.name.c_str()), bytes_(file.bytes) {}
    bool read(char target[], int count) override {
        if (count < 0 ||
            static_cast<uint64_t>(count) > bytes_.size() - std::min<uint64_t>(position_, bytes_.size()))
            throw std::runtime_error("truncated");
        std::memcpy(target, bytes_.data() + position_, count);
        position_ += count;
        return position_ < bytes_.size();
    }
    uint64_t tellg() override { return position_; }
    void seekg(uint64_t position) override { position_ = position; }

  private:
    std::string_view bytes_;
    uint64_t position_ = 0;
};

std::string height_channel(const FileBytes& file, const Imf::ChannelList& channels) {
    std::string name;
    for (const char* candidate : {"Y", "Z", "height", "R"})
        if (name.empty() && channels.findChannel(candidate)) name = candidate;
    if (name.empty() && channels.begin() != channels.end()) {
        auto second = channels.begin();
        if (++second == channels.end()) name = channels.begin().name();
    }
    if (name.empty()) refuse(file, "", "needs a channel Y, Z, height or R, or only one channel");
    if (channels[name].xSampling != 1 || channels[name].ySampling != 1)
        refuse(file, "channel " + name, "must not be sub-sampled");
    return name;
}

std::optional<double> metres_attribute(const FileBytes& file, const Imf::Header& header, const char* name) {
    std::optional<double> value;
    if (const auto* number = header.findTypedAttribute<Imf::FloatAttribute>(name)) {
        value = number->value();
    } else if (const auto* precise = header.findTypedAttribute<Imf::DoubleAttribute>(name)) {
        value = precise->value();
    } else if (const auto* text = header.findTypedAttribute<Imf::StringAttribute>(name)) {
        value = parse_number(trimmed(text->value()));
        if (!value) value = metres_per(trimmed(text->value()));
        if (!value)
            refuse(file, name + (" = " + text->value()), "must be a number of metres or a unit of length");
    }
    if (value && !(std::isfinite(*value) && *value > 0))
        refuse(file, name, "must be a number of metres above 0");
    return value;
}

constexpr std::string_view magic("\x76\x2f\x31\x01", 4);
constexpr size_t header_start = 8;  // after magic and version
constexpr uint32_t tiled_flag = 0x200, deep_flag = 0x800, multi_part_flag = 0x1000;

// Types whose values have one size, which the library reads whatever size the file states.
constexpr std::pair<uint32_t, std::string_view> types_of_size[] = {
    {1, " compression deepImageState envmap lineOrder "},
    {4, " float int "},
    {8, " double rational timecode v2f v2i "},
    {9, " tiledesc "},
    {12, " v3f v3i "},
    {16, " box2f box2i v2d "},
    {24, " v3d "},
    {28, " keycode "},
    {32, " chromaticities "},
    {36, " m33f "},
    {64, " m44f "},
    {72, " m33d "},
    {128, " m44d "}};

// Walks the attributes (name, type, size, value) before the library does: it allocates a value's stated size
// before it looks whether the file has so many bytes, and loses step with the file where size and type
// disagree.
void check_attributes(const FileBytes& file) {
    size_t position = header_start;
    auto next_name = [&] {
        const size_t end = file.bytes.find('\0', position);
        if (end == std::string_view::npos) refuse(file, "", "damaged OpenEXR: the header has no end");
        const std::string_view name = file.bytes.substr(position, end - position);
        position = end + 1;
        return name;
    };
    while (!next_name().empty()) {
        const std::string_view type = next_name();
        if (file.bytes.size() - position < 4) refuse(file, "", "damaged OpenEXR: the header has no end");
        const auto size = load<uint32_t>(&file.bytes[position], false);
        position += 4;
        if (size > file.bytes.size() - position)
            refuse(file, "", "damaged OpenEXR: an attribute is larger than the file");
        const size_t end = position + size;
        bool good = true;
        const std::string spaced = " " + std::string(type) + " ";
        for (const auto& [fixed, types] : types_of_size)
            good = good && (size == fixed || types.find(spaced) == std::string_view::npos);
        if (type == "chlist") {  // channels of a name and 16 bytes, then an empty name
            bool more = true;
            while (more && position < end) {
                more = !next_name().empty();
                if (more) position += 16;
            }
            good = !more && position == end;
        }
        if (!good)
            refuse(file, std::string(type.substr(0, 40)),
                   "damaged OpenEXR: an attribute of this type has a wrong size");
        position = end;
    }
}

// Before the library opens the file: the image, the buffers that it decodes into (up to 256 lines, or a tile,
// of all channels) and the table of tiles must be in proportion to the file.
void check_header(const FileBytes& file, const Imf::Header& header, bool tiled, const ReadLimits& limits) {
    const auto& window = header.dataWindow();
    const long long nx = 1LL + window.max.x - window.min.x, ny = 1LL + window.max.y - window.min.y;
    // The best that a compressor of OpenEXR does is DWA: one half per 8 x 8 block, deflated.
    constexpr double best_ratio = 1032 * 64;
    check_extents(file, nx, ny, limits, 2 / best_ratio, file.bytes.size());

    double channels = 0;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c) ++channels;
    double buffer = 4 * channels * 256 * static_cast<double>(nx);
    if (tiled) {
        const double tile_nx = header.tileDescription().xSize, tile_ny = header.tileDescription().ySize;
        buffer = 4 * channels * std::max(tile_nx, static_cast<double>(nx)) * tile_ny;
        const double tiles =
            std::ceil(static_cast<double>(nx) / tile_nx) * std::ceil(static_cast<double>(ny) / tile_ny);
        if (!(8 * tiles <= static_cast<double>(file.bytes.size())))
            refuse(file, "", "damaged OpenEXR: more tiles than the file can hold");
    }
    if (!(buffer <= std::max(0x1p27, 1000 * static_cast<double>(file.bytes.size()))))
        refuse(file, std::to_string(nx) + " points wide",
               "the lines or tiles are too large for a file of this size");
}

// Everything that can be wrong before a pixel is decoded.
Imf::Header checked_part(const FileBytes& file, const ReadLimits& limits, MemoryStream& stream) {
    int version = load<int32_t>(&file.bytes[4], false);
    if (version & deep_flag) refuse(file, "deep data", "the image must be flat");
    if (version & multi_part_flag) refuse(file, "several parts", "the image must be a single part");
    check_attributes(file);
    stream.seekg(header_start);
    Imf::Header header;
    header.readFrom(stream, version);
    check_header(file, header, version & tiled_flag, limits);
    return header;
}

// The named channels as floats, one plane after the other.
std::vector<float> read_planes(MemoryStream& stream, const Imf::Header& header,
                               const std::vector<std::string>& names) {
    const auto& window = header.dataWindow();
    const size_t width = static_cast<size_t>(window.max.x - window.min.x) + 1,
                 plane = width * (static_cast<size_t>(window.max.y - window.min.y) + 1);
    std::vector<float> pixels(names.size() * plane);
    Imf::FrameBuffer frame;
    for (size_t c = 0; c < names.size(); ++c)
        frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, &pixels[c * plane], window, sizeof(float),
                                                sizeof(float) * width));
    stream.seekg(0);
    Imf::InputFile input(stream, 0);
    input.setFrameBuffer(frame);
    input.readPixels(window.min.y, window.max.y);
    return pixels;
}

RawHeights read_part(const FileBytes& file, const ReadLimits& limits) {
    MemoryStream stream(file);
    const Imf::Header header = checked_part(file, limits, stream);
    const auto& window = header.dataWindow();
    RawHeights heights;
    heights.nx = window.max.x - window.min.x + 1, heights.ny = window.max.y - window.min.y + 1;
    heights.row0_at_top = true;
    const std::string channel = height_channel(file, header.channels());
    if (header.channels()[channel].type == Imf::HALF)
        heights.notes.push_back("heights are half floats: 11 significant bits, steps of 1/2048 of the value");
    heights.pitch_x = metres_attribute(file, header, "pixelPitchX_m");
    heights.pitch_y = metres_attribute(file, header, "pixelPitchY_m");
    heights.height_unit = metres_attribute(file, header, "heightUnit_m");
    const std::vector<float> pixels = read_planes(stream, header, {channel});
    heights.values.assign(pixels.begin(), pixels.end());
    return heights;
}

RadianceImage read_radiance_part(const FileBytes& file, const ReadLimits& limits) {
    MemoryStream stream(file);
    const Imf::Header header = checked_part(file, limits, stream);
    const auto& window = header.dataWindow();
    RadianceImage image;
    image.nx = window.max.x - window.min.x + 1, image.ny = window.max.y - window.min.y + 1;
    const Imf::ChannelList& channels = header.channels();
    std::vector<std::string> names{"R", "G", "B"};
    if (!channels.findChannel("R") || !channels.findChannel("G") || !channels.findChannel("B")) {
        if (!channels.findChannel("Y")) refuse(file, "", "needs the channels R, G, B, or Y");
        names = {"Y"};
    }
    for (const std::string& name : names)
        if (channels[name].xSampling != 1 || channels[name].ySampling != 1)
            refuse(file, "channel " + name, "must not be sub-sampled");
    image.n_channels = static_cast<int>(names.size());
    image.values = read_planes(stream, header, names);
    return image;
}

template <class Read>
auto decode(const FileBytes& file, Read&& read) {
    if (!file.bytes.starts_with(magic) || file.bytes.size() < header_start)
        refuse(file, "", "is not an OpenEXR file: its first bytes are wrong");
    try {
        return read();
    } catch (const Error&) {
        throw;
    } catch (const std::exception& failure) {
        refuse(file, "", std::string("damaged OpenEXR: ") + failure.what());
    }
}

}  // namespace

RawHeights read_exr(const FileBytes& file, const ReadLimits& limits) {
    return decode(file, [&] { return read_part(file, limits); });
}

RadianceImage read_exr_radiance(const FileBytes& file, const ReadLimits& limits) {
    return decode(file, [&] { return read_radiance_part(file, limits); });
}

}  // namespace gonio
