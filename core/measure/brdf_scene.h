// The scene that a BRDF plan asks for.
#pragma once
#include "measure/scene.h"
#include "measure/simplify.h"

namespace gonio {

// The surface and its facets, Lambertian ones with an albedo for each channel whatever they were written as.
SimplifiedScene simplify_brdf_scene(const HeightField& surface, const Material& material, bool allow_skips);

// Directions are turned with the surface; lights and views that are the same set are found, if
// options.allow_skips. What is referred to must outlive it; of the grid, choosing a transport needs max_slope
// alone.
MeasuredScene brdf_scene(const SimplifiedScene& simple, const MarchGrid& grid, const BrdfPlan& plan,
                         const RunOptions& options);

}  // namespace gonio
