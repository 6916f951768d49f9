// Light fields of glossy facets under an environment. Internal to measure/.
#pragma once
#include <memory>

#include "measure/glossy_btf.h"

namespace gonio {

// All random runs are made, for as many views at a time as options.max_bytes holds the sums of; the same bits
// however few these are. Values are over the environment's irradiance of the flat base plane, as Btf's. The
// references must outlive it. Throws Error as GlossyBtf does, and for RGB light on a spectrum.
std::unique_ptr<GlossyPictures> glossy_sky_pictures(const HeightField& surface, const Material& material,
                                                    const BtfPlan& plan, const Environment& environment,
                                                    const RunOptions& options, const Monitor& monitor);

// As predict_btf.
Prediction predict_sky_pictures(const HeightField& surface, const Material& material, const BtfPlan& plan);

}  // namespace gonio
