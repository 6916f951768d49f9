// What the views of a BTF or light field see, apart from the light. Internal to measure/.
#pragma once
#include "measure/btf.h"
#include "visibility/march_grid.h"

namespace gonio {

BtfShape btf_shape(const HeightField& surface, const Material& material, const BtfPlan& plan, int refinement);

// Directions of the views. Those of cameras from the middle of what they see: names for the rows of the
// means.
std::vector<AnglesDeg> view_angles(const HeightField& surface, const BtfPlan& plan);

// As Btf::view_maps. unresolved: nearly horizontal rays that were given up. Throws Error for cameras inside
// the relief; cancelled.
std::vector<uint32_t> make_view_maps(const HeightField& surface, const MarchGrid& grid, const BtfPlan& plan,
                                     const BtfShape& shape, int refinement, int n_threads,
                                     const Monitor& monitor, double& unresolved);

}  // namespace gonio
