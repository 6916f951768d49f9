// A file of tests/validation/data.
#pragma once
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace gonio::reference {

inline nlohmann::json load_json(const std::string& name) {
    const std::string path = GONIO_TEST_DATA "/validation/data/" + name + ".json";
    std::ifstream file(path);
    if (!file) throw std::runtime_error("cannot read " + path);
    return nlohmann::json::parse(file);
}

}  // namespace gonio::reference
