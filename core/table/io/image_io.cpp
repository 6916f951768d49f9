#include "table/io/image_io.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "base/atomic_file.h"
#include "base/error.h"

namespace gonio {
namespace {

// IEC 61966-2-1.
double srgb(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

struct PngWriter {
    png_structp png = nullptr;
    png_infop info = nullptr;
    explicit PngWriter(const std::string& path) : path_(path) {
        png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &path_, fail, nullptr);
        if (png) info = png_create_info_struct(png);
        if (!info) throw Error(ErrorCode::limit, path, "", "out of memory");
    }
    ~PngWriter() { png_destroy_write_struct(&png, &info); }
    PngWriter(const PngWriter&) = delete;
    PngWriter& operator=(const PngWriter&) = delete;

  private:
    static void fail(png_structp png, png_const_charp message) {
        throw Error(ErrorCode::io, *static_cast<const std::string*>(png_get_error_ptr(png)), "",
                    std::string("cannot be written as PNG: ") + message);
    }
    std::string path_;
};

}  // namespace

std::string exr_channel_name(const std::string& channel) {
    if (channel == "r" || channel == "g" || channel == "b" || channel == "y")
        return std::string(1, static_cast<char>(channel[0] - 'a' + 'A'));
    std::string name = channel;
    std::replace(name.begin(), name.end(), '.', ',');
    return name;
}

void write_exr_picture(const Picture& picture, const std::string& path) {
    const auto write = [&](const std::string& temporary) {
        Imf::Header header(picture.width, picture.height);
        header.compression() = Imf::ZIP_COMPRESSION;
        std::string comments;
        for (const auto& [key, value] : picture.attributes) {
            comments += key + ": " + value + "\n";
            header.insert(("gonio." + key).substr(0, 255).c_str(), Imf::StringAttribute(value));
        }
        header.insert("comments", Imf::StringAttribute(comments));
        Imf::FrameBuffer frame;
        const auto row = static_cast<ptrdiff_t>(sizeof(float)) * picture.width;
        for (const Picture::Channel& channel : picture.channels) {
            header.channels().insert(channel.name, Imf::Channel(Imf::FLOAT));
            // From the last row backwards. The library's slices are not const, though writing only reads
            // them.
            char* top = reinterpret_cast<char*>(const_cast<float*>(channel.pixels.data())) +
                        row * (picture.height - 1);
            frame.insert(channel.name, Imf::Slice(Imf::FLOAT, top, sizeof(float), static_cast<size_t>(-row)));
        }
        Imf::OutputFile file(temporary.c_str(), header, 0);
        file.setFrameBuffer(frame);
        file.writePixels(picture.height);
    };
    try {
        write_path_atomically(path, write);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& failure) {  // Iex exceptions of the library
        throw Error(ErrorCode::io, path, "", std::string("cannot be written as OpenEXR: ") + failure.what());
    }
}

void write_png_picture(const PngChannels& picture, const std::string& path) {
    write_path_atomically(path, [&](const std::string& temporary) {
        const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(temporary.c_str(), "wb"),
                                                                   std::fclose);
        if (!file) throw Error(ErrorCode::io, path, "", "cannot be written");
        PngWriter writer(path);
        png_init_io(writer.png, file.get());
        const size_t n = picture.channels.size(), width = static_cast<size_t>(picture.width);
        png_set_IHDR(writer.png, writer.info, picture.width, picture.height, 8,
                     n == 1 ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                     PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
        std::vector<std::pair<std::string, std::string>> named = picture.attributes;
        std::vector<png_text> texts;
        for (auto& [key, value] : named) {
            png_text text{};
            text.compression = PNG_TEXT_COMPRESSION_NONE;
            text.key = key.data();
            text.text = value.data();
            texts.push_back(text);
        }
        png_set_text(writer.png, writer.info, texts.data(), static_cast<int>(texts.size()));
        png_write_info(writer.png, writer.info);
        std::vector<png_byte> line(n * width);
        for (int row = picture.height - 1; row >= 0; --row) {
            for (size_t i = 0; i < width; ++i)
                for (size_t c = 0; c < n; ++c) {
                    const double value =
                        std::clamp(picture.channels[c][row * width + i] * picture.scale, 0.0, 1.0);
                    line[i * n + c] =
                        static_cast<png_byte>(std::lround(255 * (picture.linear ? value : srgb(value))));
                }
            png_write_row(writer.png, line.data());
        }
        png_write_end(writer.png, writer.info);
        if (std::fflush(file.get()) != 0 || std::ferror(file.get()))
            throw Error(ErrorCode::io, path, "", "cannot be written");
    });
}

}  // namespace gonio
