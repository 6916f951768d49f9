#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "material/lobe_parameters.h"
#include "server/load_job.h"

namespace gonio {
namespace {

// The map in the place of the heights: same stored grid, same way to the prepared one, its numbers untouched.
PrepareOptions registration(const SurfaceSource& source) {
    PrepareOptions options;
    if (const auto* file = std::get_if<FileSurface>(&source)) options = file->options;
    if (const auto* grid = std::get_if<GridSurface>(&source)) options = grid->options;
    PrepareOptions same_place;
    same_place.y_up = options.y_up;
    same_place.crop = options.crop;
    same_place.resample = options.resample;
    // Cells mirror differently from nodes, see mirrored_cell; "open" keeps what is not periodic from
    // wrapping.
    same_place.boundary = options.boundary == Boundary::periodic ? Boundary::periodic : Boundary::open;
    same_place.pitch_x = same_place.pitch_y = same_place.height_scale = 1;
    return same_place;
}

// Of n cells, the one that cell k of a surface mirrored to 2 n shows. Nodes mirror as 0 .. n-1 n-1 .. 0, so
// cell k, between nodes k and k + 1, has its twin at 2 n - 2 - k; the two flat cells at the mirror lines take
// their neighbour's albedo.
int mirrored_cell(int k, int n) {
    return k < n ? k : std::max(0, 2 * n - 2 - k);
}

RawHeights read_numbers(const ParameterMap& map, const std::string& path, const HeightReader& read,
                        const ParameterRange& range) {
    RawHeights raw = read(path);
    const double scale = raw.integer_max > 0 ? 1 / raw.integer_max : 1;
    for (size_t k = 0; k < raw.values.size(); ++k) {
        raw.values[k] *= scale;
        if (!(raw.values[k] >= range.low && raw.values[k] <= range.high)) {
            throw Error(ErrorCode::invalid_input, map.field, number_text(raw.values[k]),
                        path + ": must lie from " + number_text(range.low) + " to " +
                            number_text(range.high) + "; found at column " + std::to_string(k % raw.nx) +
                            ", row " + std::to_string(k / raw.nx));
        }
    }
    raw.bits = 0, raw.integer_max = 0;
    raw.pitch_x = raw.pitch_y = raw.height_unit = std::nullopt;
    return raw;
}

class MapLoader {
  public:
    MapLoader(const HeightReader& read, const SurfaceSource& source, const LoadedSurface& loaded)
        : read_(read), source_(source), loaded_(loaded) {}

    Parameter load(const ParameterMap& map, const ParameterRange& range) const {
        Parameter parameter;
        for (const std::string& path : map.paths) append(map, path, range, parameter);
        return parameter;
    }

  private:
    // One channel, behind those before it.
    void append(const ParameterMap& from, const std::string& path, const ParameterRange& range,
                Parameter& parameter) const {
        const HeightField& surface = loaded_.surface;
        const int nx = loaded_.stored_nx ? loaded_.stored_nx : surface.nx;
        const int ny = loaded_.stored_ny ? loaded_.stored_ny : surface.ny;
        RawHeights raw = read_numbers(from, path, read_, range);
        if (raw.nx != nx || raw.ny != ny) {
            throw Error(ErrorCode::invalid_input, from.field,
                        std::to_string(raw.nx) + " x " + std::to_string(raw.ny),
                        path + ": the map must have the size of the surface, " + std::to_string(nx) + " x " +
                            std::to_string(ny));
        }
        const HeightField map = prepare_surface(std::move(raw), registration(source_)).surface;
        parameter.map_nx = surface.nx, parameter.map_ny = surface.ny;
        parameter.map.reserve(parameter.map.size() + surface.heights.size());
        for (int j = 0; j < surface.ny; ++j)
            for (int i = 0; i < surface.nx; ++i) {
                const float above_mean = map.at(mirrored_cell(i, map.nx), mirrored_cell(j, map.ny));
                parameter.map.push_back(
                    static_cast<float>(std::clamp(above_mean + map.mean_height, range.low, range.high)));
            }
    }

    const HeightReader& read_;
    const SurfaceSource& source_;
    const LoadedSurface& loaded_;
};

}  // namespace

Material load_material(const MaterialSource& source, const SurfaceSource& surface_source,
                       const LoadedSurface& surface) {
    Material material = source.material;
    const MapLoader loader(source.read, surface_source, surface);
    for (const ParameterMap& map : source.maps) {
        WeightedLobe& part = material.lobes[map.part];
        if (map.parameter == "weight") part.weight = loader.load(map, share_range);
        std::visit(
            [&](auto& lobe) {
                visit_parameters(lobe,
                                 [&](const char* name, Parameter& parameter, const ParameterRange& range) {
                                     if (name == map.parameter) parameter = loader.load(map, range);
                                 });
            },
            part.lobe);
    }
    validate(material, surface.surface.nx, surface.surface.ny);
    return simplified(std::move(material));
}

}  // namespace gonio
