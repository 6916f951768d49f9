#include <filesystem>

#include "base/error.h"
#include "server/load_job.h"
#include "visibility/curvature.h"

namespace gonio {
namespace {

std::string size_text(int nx, int ny) {
    return std::to_string(nx) + " x " + std::to_string(ny) + " points";
}

LoadedSurface from_stored(RawHeights raw, const PrepareOptions& options, const std::string& name) {
    LoadedSurface loaded;
    loaded.stored_nx = raw.nx;
    loaded.stored_ny = raw.ny;
    loaded.description = name + ", " + raw.format + ", " + size_text(raw.nx, raw.ny);
    PreparedSurface prepared = prepare_surface(std::move(raw), options);
    loaded.surface = std::move(prepared.surface);
    loaded.notes = std::move(prepared.notes);
    return loaded;
}

LoadedSurface load(const FileSurface& source) {
    return from_stored(source.read(source.path), source.options,
                       std::filesystem::path(source.path).filename().string());
}

LoadedSurface load(const GridSurface& source) {
    return from_stored(source.grid, source.options, "grid of the job");
}

LoadedSurface load(const GeneratedSurface& source) {
    LoadedSurface loaded;
    try {
        loaded.surface = source.generate();
    } catch (const Error& error) {
        // Generators name their own members ("groove_width"); in a job these are keys of "/surface".
        throw Error(error.code(), "/surface/" + error.field(), error.value(), error.allowed());
    }
    loaded.description = "generated " + source.name + ", " + size_text(loaded.surface.nx, loaded.surface.ny);
    return loaded;
}

}  // namespace

LoadedSurface load_surface(const SurfaceSource& source, const BaseCurvature& base) {
    LoadedSurface loaded = std::visit([](const auto& kind) { return load(kind); }, source);
    loaded.surface.base = base;
    check_base(loaded.surface);
    loaded.hash = surface_hash(loaded.surface);
    loaded.statistics = surface_statistics(loaded.surface);
    loaded.warnings = surface_warnings(loaded.surface, loaded.statistics);
    for (std::string& warning : base_warnings(loaded.surface)) loaded.warnings.push_back(std::move(warning));
    return loaded;
}

}  // namespace gonio
