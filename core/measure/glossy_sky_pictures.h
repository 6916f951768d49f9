// Light fields of glossy facets under an environment. Internal to measure/.
#pragma once
#include <memory>

#include "measure/glossy_btf.h"

namespace gonio {

// All random runs are made, for every pixel; the sums of all pictures are in memory until they are shown.
// Values are over the environment's irradiance of the flat base plane, as Btf's. The references must outlive
// it. Throws Error as GlossyBtf does, and for RGB light on a spectrum.
std::unique_ptr<GlossyPictures> glossy_sky_pictures(const HeightField& surface, const Material& material,
                                                    const BtfPlan& plan, const Environment& environment,
                                                    const RunOptions& options, const Monitor& monitor);

// Their settings, and working memory at the peak.
Accuracy::Samples sky_pictures_samples(const BtfPlan& plan);
double sky_pictures_bytes(const HeightField& surface, const BtfShape& shape,
                          const Accuracy::Samples& samples);

}  // namespace gonio
