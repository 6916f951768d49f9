#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "server/load_job.h"

namespace gonio {
namespace {

const char* const field = "/material/albedo";

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

RawHeights read_albedos(const std::string& path, const HeightReader& read) {
    RawHeights raw = read(path);
    const double scale = raw.integer_max > 0 ? 1 / raw.integer_max : 1;
    for (size_t k = 0; k < raw.values.size(); ++k) {
        raw.values[k] *= scale;
        if (!(raw.values[k] >= 0 && raw.values[k] <= 1)) {
            throw Error(ErrorCode::invalid_input, field, number_text(raw.values[k]),
                        path + ": albedos must lie from 0 to 1; found at column " +
                            std::to_string(k % raw.nx) + ", row " + std::to_string(k / raw.nx));
        }
    }
    raw.bits = 0, raw.integer_max = 0;
    raw.pitch_x = raw.pitch_y = raw.height_unit = std::nullopt;
    return raw;
}

// One channel's map, appended to the channels before it.
void load_map(RawHeights raw, const std::string& path, const SurfaceSource& source,
              const LoadedSurface& loaded, Parameter& albedo) {
    const int nx = loaded.stored_nx ? loaded.stored_nx : loaded.surface.nx;
    const int ny = loaded.stored_ny ? loaded.stored_ny : loaded.surface.ny;
    if (raw.nx != nx || raw.ny != ny) {
        throw Error(ErrorCode::invalid_input, field, std::to_string(raw.nx) + " x " + std::to_string(raw.ny),
                    path + ": the map must have the size of the surface, " + std::to_string(nx) + " x " +
                        std::to_string(ny));
    }
    const HeightField map = prepare_surface(std::move(raw), registration(source)).surface;
    albedo.map_nx = loaded.surface.nx, albedo.map_ny = loaded.surface.ny;
    albedo.map.reserve(albedo.map.size() + loaded.surface.heights.size());
    for (int j = 0; j < albedo.map_ny; ++j) {
        for (int i = 0; i < albedo.map_nx; ++i) {
            const float above_mean = map.at(mirrored_cell(i, map.nx), mirrored_cell(j, map.ny));
            albedo.map.push_back(static_cast<float>(std::clamp(above_mean + map.mean_height, 0.0, 1.0)));
        }
    }
}

}  // namespace

Material load_material(const MaterialSource& source, const SurfaceSource& surface_source,
                       const LoadedSurface& surface) {
    Material material = source.material;
    if (!source.albedo_maps.empty()) {
        Parameter albedo;
        for (const std::string& path : source.albedo_maps)
            load_map(read_albedos(path, source.read), path, surface_source, surface, albedo);
        material.lobes = {{1.0, Lambertian{std::move(albedo)}}};
    }
    validate(material, surface.surface.nx, surface.surface.ny);
    return material;
}

}  // namespace gonio
