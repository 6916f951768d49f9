// The normal distribution of a surface and its fits as JSON.
#pragma once
#include <string>

#include "fitting/ndf.h"
#include "server/load_job.h"

namespace gonio {

// Members as in NdfResult; angles in degrees, d in 1/sr, last axis phi.
std::string ndf_json(const LoadedSurface& surface, const NdfResult& ndf);

}  // namespace gonio
