// What the views of a BTF or light field see, apart from the light. Internal to measure/.
#pragma once
#include <optional>
#include <span>

#include "measure/btf.h"
#include "scattering/irradiance.h"
#include "visibility/march_grid.h"

namespace gonio {

BtfShape btf_shape(const HeightField& surface, const Material& material, const BtfPlan& plan, int refinement);

// Of the plane that a plan's pixels lie in: metres above the mean height.
double view_plane_height(const HeightField& surface, const BtfPlan& plan);

// Unit direction from the centre of a pixel of that plane to a camera.
Vec3 pixel_to_camera(const HeightField& surface, double plane_height, const Vec3& camera,
                     const BtfShape& shape, size_t pixel);

// Directions of the views. Those of cameras from the middle of what they see: names for the rows of the
// means.
std::vector<AnglesDeg> view_angles(const HeightField& surface, const BtfPlan& plan);

// The grid that views march where it is not that of the light: what a bent base shows is bent, also where its
// shadows are corrected ones of the flat relief. Throws Error("/base") for cameras over a curved base.
std::optional<MarchGrid> bent_view_grid(const HeightField& surface, const BtfPlan& plan);

// What the mean of a view's pixels may differ from the BRDF by, relative, on a curved base: the frames of the
// pixels, in which the view is told, have turned against those of the facets that they show by curvature
// times height over the pixels' plane times tan theta, in the mean; what is seen changes by tan theta with
// that. Differences of Lambertian facets were up to 1.2 times as much. map: [sample][pixel] of the view.
double frame_doubt(const HeightField& surface, const BtfPlan& plan, std::span<const uint32_t> map, int view);

// As Btf::view_maps, of some of the views. place: in [0, 1)^2, where inside the pixels the sampled places
// begin; pixel_centre for those of a BTF. unresolved: nearly horizontal rays that were given up. Throws Error
// for cameras inside the relief; cancelled.
inline constexpr SubSample pixel_centre{0.5, 0.5};
std::vector<uint32_t> make_view_maps(const HeightField& surface, const MarchGrid& grid, const BtfPlan& plan,
                                     const BtfShape& shape, const std::vector<int>& views,
                                     const SubSample& place, int refinement, int n_threads,
                                     const Monitor& monitor, double& unresolved);

}  // namespace gonio
