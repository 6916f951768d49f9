// The name of a job: what decides its result, and nothing else.
#pragma once
#include <string>

#include "measure/reference.h"
#include "server/job.h"

namespace gonio {

// "gonio 0.1.0"
std::string program_version();

// The job as JSON with sorted keys, every default filled in, angles as lists. The surface appears as the hash
// of what is simulated, an albedo map as the hash of its values: file names, spelling of units and outputs do
// not matter. `reference`: the job as the path tracer runs it, another result with another name; null for the
// fast engine.
std::string canonical_job(const std::string& surface_hash, const Material& material, const MeasurePlan& plan,
                          const ReferenceOptions* reference = nullptr);

// SHA-256 of canonical_job, 64 hex digits.
std::string job_hash(const std::string& surface_hash, const Material& material, const MeasurePlan& plan,
                     const ReferenceOptions* reference = nullptr);

// The same without what only says when to stop (target_relative_error, max_seconds): jobs of equal runs hash
// can have runs in common.
std::string runs_hash(const std::string& surface_hash, const Material& material, MeasurePlan plan,
                      const ReferenceOptions* reference = nullptr);

}  // namespace gonio
