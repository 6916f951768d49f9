// Files of strangers in formats whose decoders have known holes. 15 published CVEs affect OpenEXR 3.1.5,
// which Debian 12 ships without a fix for any of them: an uploaded EXR file is decoded by a child process
// that may compute and write to one pipe, and do nothing else.
#pragma once
#include <string>

#include "surface/io/height_reader.h"
#include "surface/io/radiance_image.h"

namespace gonio {

inline constexpr ReadLimits untrusted_limits{1LL << 26, 1LL << 30};

// A HeightReader: the formats above in a child of this very program (`gonio decode-untrusted`), the others
// here. A child that breaks its limits or is killed is Error(invalid_input) naming the file.
RawHeights read_untrusted_heights(const std::string& path);

// A RadianceReader: the same of images of radiance.
RadianceImage read_untrusted_radiance(const std::string& path);

// From here on this process has memory, the files that are open, and its end: a call that would open a file,
// start a process or send anything kills it. Throws Error(internal) where the system has no seccomp filters.
void give_up_system_calls();

// The child's side: decodes the file after giving up everything else and writes its "heights" or "radiance",
// whichever is its content, to standard output. Returns the exit code.
int decode_untrusted(const std::string& content, const std::string& path);

}  // namespace gonio
