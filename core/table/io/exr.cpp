// OpenEXR: the table as pictures, float32, ZIP, one part, so that image viewers and every EXR library open
// it.
//
// Full product of directions, up to max_layered_channels: one layer per incident direction, `i000.R`, with
// its companions `i000.stdErr.R` and `i000.bias.R` (`i000.order1.R` and so on for single orders) and the
// string attributes `i000.thetaI`, `i000.phiI`. The image is the set of outgoing directions in the order of
// the job, never resampled: rows theta and columns phi if the set is such a grid, else wrapped to the divisor
// of its size nearest the square. The channels `thetaO` and `phiO` tell each pixel's direction; where it
// is the centre of a cell, `thetaOMin`, `thetaOMax`, `phiOMin`, `phiOMax` tell the bounds in degrees,
// `solidAngleO` and `projectedSolidAngleO` its size in sr. Beyond that number of channels (the header would
// grow to megabytes) the images of all incident directions stand below each other in one layer without a
// name, and the channels `thetaI`, `phiI` join in: attribute `layout` = "stacked". A list of pairs is a
// wrapped image with all four channels of angles: `layout` = "pairs". Names: r g b y become R G B Y,
// "450.5nm" becomes "450,5nm" (a dot would split the layer's name).
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "table/io/formats.h"

namespace gonio {
namespace {

constexpr size_t max_layered_channels = 16384;

struct Image {
    size_t width = 1, height = 1;
};

// Length of the run of equal theta at the start, if the set is a product grid with theta slowest; else 0.
size_t grid_columns(const std::vector<AnglesDeg>& directions) {
    size_t columns = 1;
    while (columns < directions.size() && directions[columns].theta_deg == directions[0].theta_deg) ++columns;
    if (directions.size() % columns != 0) return 0;
    for (size_t k = 0; k < directions.size(); ++k) {
        if (directions[k].phi_deg != directions[k % columns].phi_deg) return 0;
        if (directions[k].theta_deg != directions[k - k % columns].theta_deg) return 0;
    }
    return columns;
}

// No padding ever: a pixel without a direction would need a value that is none.
Image wrap(size_t pixels) {
    Image image{pixels, 1};
    for (size_t height = 1; height * height <= pixels; ++height)
        if (pixels % height == 0) image = {pixels / height, height};
    return image;
}

std::string channel_name(const std::string& channel) {
    if (channel == "r" || channel == "g" || channel == "b" || channel == "y")
        return std::string(1, static_cast<char>(channel[0] - 'a' + 'A'));
    std::string name = channel;
    std::replace(name.begin(), name.end(), '.', ',');
    return name;
}

std::string layer_name(size_t incident, size_t n_incident) {
    const std::string number = std::to_string(incident);
    const size_t digits = std::max<size_t>(3, std::to_string(n_incident - 1).size());
    return "i" + std::string(digits - number.size(), '0') + number;
}

// Collects the channels; what they point at is the table's own memory, nothing is copied but the angles.
class Picture {
  public:
    Picture(Image image, const std::string& layout)
        : image_(image), header_(static_cast<int>(image.width), static_cast<int>(image.height)) {
        header_.compression() = Imf::ZIP_COMPRESSION;
        attribute("layout", layout);
    }
    void attribute(const std::string& name, const std::string& value) {
        header_.insert(name.c_str(), Imf::StringAttribute(value));
    }
    void channel(const std::string& name, const float* pixels) {
        header_.channels().insert(name, Imf::Channel(Imf::FLOAT));
        // The library's slices are not const, though writing only reads them.
        frame_.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(pixels)),
                                       sizeof(float), sizeof(float) * image_.width));
    }
    void write(const std::string& path) {
        Imf::OutputFile file(path.c_str(), header_, 0);
        file.setFrameBuffer(frame_);
        file.writePixels(static_cast<int>(image_.height));
    }

  private:
    Image image_;
    Imf::Header header_;
    Imf::FrameBuffer frame_;
};

// All channels of one layer; `first` is the row of the table that stands at the image's first pixel.
void add_layer(Picture& picture, const Table& table, const std::string& prefix, size_t first) {
    for (size_t channel = 0; channel < table.channels.size(); ++channel) {
        const std::string name = channel_name(table.channels[channel]);
        for (size_t slice = 0; slice < table.slices(); ++slice) {
            const std::string layer = prefix + (slice == 0 ? "" : "order" + std::to_string(slice) + ".");
            const size_t k = table.index(channel, slice, first);
            picture.channel(layer + name, &table.f[k]);
            picture.channel(layer + "stdErr." + name, &table.se[k]);
            picture.channel(layer + "bias." + name, &table.bias[k]);
        }
    }
}

// Bounds and size of each pixel's cell; nothing for point directions.
std::vector<std::pair<std::string, std::vector<float>>> cell_pixels(const Table& table, size_t pixels) {
    if (table.cells.empty()) return {};
    std::vector<std::pair<std::string, std::vector<float>>> channels;
    auto add = [&](const char* name, auto&& value_of) {
        std::vector<float> values(pixels);
        for (size_t row = 0; row < pixels; ++row)
            values[row] = static_cast<float>(value_of(table.cells[table.pair(row).second]));
        channels.emplace_back(name, std::move(values));
    };
    add("thetaOMin", [](const ReceiverCell& c) { return c.theta_min_deg; });
    add("thetaOMax", [](const ReceiverCell& c) { return c.theta_max_deg; });
    add("phiOMin", [](const ReceiverCell& c) { return c.phi_min_deg; });
    add("phiOMax", [](const ReceiverCell& c) { return c.phi_max_deg; });
    add("solidAngleO", solid_angle);
    add("projectedSolidAngleO", projected_solid_angle);
    return channels;
}

void add_provenance(Picture& picture, const Table& table, const std::string& parameterisation) {
    std::string comments;
    for (const std::string_view line : table_conventions) comments.append(line).append("\n");
    if (!table.cells.empty()) comments.append(cell_convention).append("\n");
    for (const auto& [key, value] : table.provenance) {
        comments += key + ": " + value + "\n";
        // OpenEXR allows 255 bytes in a name; the comments carry the key in full.
        picture.attribute(("gonio." + key).substr(0, 255), value);
    }
    picture.attribute("comments", comments);
    picture.attribute("units", "1/sr");
    picture.attribute("parameterisation", parameterisation);
}

}  // namespace

void write_exr(const Table& table, const std::string& path) {
    const size_t channels_per_layer = 3 * table.channels.size() * table.slices();
    const bool is_layered =
        table.pairs.empty() && table.incident.size() * channels_per_layer <= max_layered_channels;
    const std::string layout = !table.pairs.empty() ? "pairs" : is_layered ? "layers" : "stacked";

    Image image = wrap(table.pairs.empty() ? table.outgoing.size() : table.pairs.size());
    std::string parameterisation = "list: one pixel a direction, row by row";
    if (const size_t columns = table.pairs.empty() ? grid_columns(table.outgoing) : 0) {
        image = {columns, table.outgoing.size() / columns};
        parameterisation = "grid: one row a theta, one column a phi";
    }
    if (layout == "stacked") image.height *= table.incident.size();
    const size_t pixels = image.width * image.height;
    if (std::max(image.width, image.height) > static_cast<size_t>(std::numeric_limits<int>::max())) {
        throw Error(ErrorCode::limit, path, std::to_string(table.rows()) + " rows",
                    "too many for an image; use csv or json");
    }

    try {
        Picture picture(image, layout);
        add_provenance(picture, table, parameterisation);
        std::vector<float> theta_i, phi_i, theta_o(pixels), phi_o(pixels);
        for (size_t row = 0; row < pixels; ++row) {
            const AnglesDeg& wo = table.outgoing[table.pair(row).second];
            theta_o[row] = static_cast<float>(wo.theta_deg);
            phi_o[row] = static_cast<float>(wo.phi_deg);
        }
        picture.channel("thetaO", theta_o.data());
        picture.channel("phiO", phi_o.data());
        const std::vector<std::pair<std::string, std::vector<float>>> bounds = cell_pixels(table, pixels);
        for (const auto& [name, values] : bounds) picture.channel(name, values.data());
        if (is_layered) {
            for (size_t i = 0; i < table.incident.size(); ++i) {
                const std::string layer = layer_name(i, table.incident.size()) + ".";
                picture.attribute(layer + "thetaI", number_text(table.incident[i].theta_deg));
                picture.attribute(layer + "phiI", number_text(table.incident[i].phi_deg));
                add_layer(picture, table, layer, i * table.outgoing.size());
            }
        } else {
            theta_i.resize(pixels);
            phi_i.resize(pixels);
            for (size_t row = 0; row < pixels; ++row) {
                const AnglesDeg& wi = table.incident[table.pair(row).first];
                theta_i[row] = static_cast<float>(wi.theta_deg);
                phi_i[row] = static_cast<float>(wi.phi_deg);
            }
            picture.channel("thetaI", theta_i.data());
            picture.channel("phiI", phi_i.data());
            add_layer(picture, table, "", 0);
        }
        picture.write(path);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& failure) {  // Iex exceptions of the library
        throw Error(ErrorCode::io, path, "", std::string("cannot be written as OpenEXR: ") + failure.what());
    }
}

}  // namespace gonio
