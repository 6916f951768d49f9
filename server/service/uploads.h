// Where a job document of the service names files: by the SHA-256 of what was uploaded, never by a path.
#pragma once
#include <nlohmann/json.hpp>

#include "server/job.h"
#include "server/store/objects.h"

namespace gonio {

struct UploadedFiles {
    nlohmann::json document;            // with "file" and "files" for the command line's parser
    std::vector<std::string> surfaces;  // SHA-256 of what it names
};

// Replaces {"sha256": "..."} of the surface and of an albedo map, {"sha256": ["...", ...]} of several maps.
// Throws Error(invalid_input) for a file of the server and for what was not uploaded, with pointers into the
// document.
UploadedFiles resolve_uploads(const nlohmann::json& document, const Objects& objects);

// Every file of the job is read as a stranger's.
void read_as_untrusted(SurfaceSource& surface);
void read_as_untrusted(Job& job);

}  // namespace gonio
