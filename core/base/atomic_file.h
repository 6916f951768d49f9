// Files that are either whole or not there, after a crash too.
#pragma once
#include <functional>
#include <iosfwd>
#include <string>

namespace gonio {

// Writes `path` aside (same folder), fsyncs it, renames it, fsyncs the folder; removes the temporary if
// `write` throws.
void write_file_atomically(const std::string& path, const std::function<void(std::ostream&)>& write);
// The same for libraries that want a file name: `write` gets the temporary's path.
void write_path_atomically(const std::string& path,
                           const std::function<void(const std::string& temporary)>& write);

}  // namespace gonio
