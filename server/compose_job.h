// Writing a job document: how the short forms of the command line become the one description that everything
// runs from.
#pragma once
#include <string>
#include <vector>

namespace gonio {

struct JobEntry {
    std::string pointer;  // where it goes: "/surface/width", "/output/0/path"
    std::string value;    // a text, or JSON if is_json
    bool is_json = false;
};

// The document with these entries, indented. Throws Error(invalid_input) naming the pointer if a JSON value
// is not JSON.
std::string compose_job(const std::vector<JobEntry>& entries);

}  // namespace gonio
