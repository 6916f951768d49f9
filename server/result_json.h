// What machines read: surfaces, results and failures as JSON. server/README.md says which members are stable.
#pragma once
#include <string>
#include <vector>

#include "base/error.h"
#include "server/run_job.h"

namespace gonio {

// All indented by `indent` spaces; -1: on one line.
std::string surface_json(const LoadedSurface& surface, int indent);

// status "done": job_hash, surface, outputs written, report.
std::string result_json(const LoadedJob& job, const Report& report, const std::vector<OutputRequest>& written,
                        int indent);

// A job that did not run: status "planned" (dry run, with the canonical job) or "skipped" (its result is
// there already).
std::string planned_json(const LoadedJob& job, int indent);
std::string skipped_json(const LoadedJob& job, const std::vector<OutputRequest>& present, int indent);

// status "failed": code, field, value, message.
std::string failure_json(const Error& error, int indent);

// "invalid_input", ...
std::string error_code_name(ErrorCode code);

}  // namespace gonio
