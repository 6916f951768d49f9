// Shards and other finished parts as bytes. They never leave the program version that wrote them.
#pragma once
#include <string>

#include "measure/mesh_bias.h"
#include "measure/noise_bias.h"
#include "measure/run.h"
#include "scattering/path_tracer.h"

namespace gonio {

std::string to_bytes(const RunValues& values);
std::string to_bytes(const NoiseBias& bias);
std::string to_bytes(const MeshBias& bias);
std::string to_bytes(const PathTally& tally);
std::string to_bytes(double number);

// Throw Error(io) if the bytes are none of theirs.
RunValues run_values_from(const std::string& bytes);
NoiseBias noise_bias_from(const std::string& bytes);
MeshBias mesh_bias_from(const std::string& bytes);
PathTally path_tally_from(const std::string& bytes);
double number_from(const std::string& bytes);

}  // namespace gonio
