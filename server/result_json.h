// What machines read: surfaces, results and failures as JSON. server/README.md says which members are stable.
#pragma once
#include <string>
#include <vector>

#include "base/error.h"
#include "server/run_job.h"

namespace gonio {

struct JsonStyle {
    int indent = 2;   // -1: all on one line, as batches print
    std::string job;  // first member "job", if not empty: which of many this is
};

std::string surface_json(const LoadedSurface& surface);

// status "done": job_hash, outputs written, report, surface.
std::string result_json(const LoadedJob& job, const Report& report, const std::vector<OutputRequest>& written,
                        const JsonStyle& style = {});

// A job that did not run: status "planned" (dry run, with the canonical job) or "skipped" (its result is
// there already).
std::string planned_json(const LoadedJob& job, const JsonStyle& style = {});
std::string skipped_json(const LoadedJob& job, const std::vector<OutputRequest>& present,
                         const JsonStyle& style = {});

// status "failed": code, field, value, message.
std::string failure_json(const Error& error, const JsonStyle& style = {});

}  // namespace gonio
