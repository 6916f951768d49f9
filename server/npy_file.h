// NumPy's .npy files that say what is in them: behind the array, where NumPy does not look, the last line of
// the file is JSON.
#pragma once
#include <functional>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <vector>

namespace gonio {

// Whole or not at all. descr: the type of a number as Python text, "'<f4'" or a list of fields; `write` puts
// out the numbers of `shape`, the last axis fastest, as they lie in memory, and returns what the last line
// shall say of them, with job_provenance() in its last 2 MiB.
void write_npy_file(const std::string& path, const std::string& descr, const std::vector<size_t>& shape,
                    const std::function<nlohmann::ordered_json(std::ostream&)>& write);

}  // namespace gonio
