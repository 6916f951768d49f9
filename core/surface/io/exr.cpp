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
#include <ImfTestFile.h>

#include <cmath>

#include "base/units.h"
#include "surface/io/formats.h"

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

RawHeights read_part(const FileBytes& file, const ReadLimits& limits) {
    MemoryStream stream(file);
    Imf::InputFile input(stream, 0);
    const Imf::Header& header = input.header();
    const auto& window = header.dataWindow();
    const long long nx = 1LL + window.max.x - window.min.x, ny = 1LL + window.max.y - window.min.y;
    // The best that a compressor of OpenEXR does is DWA: one half per 8 x 8 block, deflated.
    constexpr double best_ratio = 1032 * 64;
    check_extents(file, nx, ny, limits, 2 / best_ratio, file.bytes.size());

    RawHeights heights;
    heights.nx = static_cast<int>(nx), heights.ny = static_cast<int>(ny);
    heights.row0_at_top = true;
    const std::string channel = height_channel(file, header.channels());
    if (header.channels()[channel].type == Imf::HALF)
        heights.notes.push_back("heights are half floats: 11 significant bits, steps of 1/2048 of the value");
    heights.pitch_x = metres_attribute(file, header, "pixelPitchX_m");
    heights.pitch_y = metres_attribute(file, header, "pixelPitchY_m");
    heights.height_unit = metres_attribute(file, header, "heightUnit_m");

    std::vector<float> pixels(static_cast<size_t>(nx) * ny);
    Imf::FrameBuffer frame;
    frame.insert(channel,
                 Imf::Slice::Make(Imf::FLOAT, pixels.data(), window, sizeof(float), sizeof(float) * nx));
    input.setFrameBuffer(frame);
    input.readPixels(window.min.y, window.max.y);
    heights.values.assign(pixels.begin(), pixels.end());
    return heights;
}

}  // namespace

RawHeights read_exr(const FileBytes& file, const ReadLimits& limits) {
    constexpr std::string_view magic("\x76\x2f\x31\x01", 4);
    if (!file.bytes.starts_with(magic)) refuse(file, "", "is not an OpenEXR file: its first bytes are wrong");
    // Before any decoding: the library refuses headers beyond these by itself.
    Imf::Header::setMaxImageSize(1 << 24, 1 << 24);
    Imf::Header::setMaxTileSize(1 << 13, 1 << 13);
    try {
        MemoryStream stream(file);
        bool tiled = false, deep = false, multi_part = false;
        Imf::isOpenExrFile(stream, tiled, deep, multi_part);
        if (deep) refuse(file, "deep data", "a height map must be flat");
        if (multi_part) refuse(file, "several parts", "a height map must be a single part");
        return read_part(file, limits);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& failure) {
        refuse(file, "", std::string("damaged OpenEXR: ") + failure.what());
    }
}

}  // namespace gonio
