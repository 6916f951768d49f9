// What was done: settings chosen, work skipped and why, events counted, time by stage.
#pragma once
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace gonio {

struct Report {
    std::vector<std::pair<std::string, std::string>>
        settings;  // "transport" = "diffuse operator", "directions" = "64", ...
    std::vector<std::pair<std::string, std::string>> skipped;  // what -> why
    std::vector<std::pair<std::string, double>> seconds;       // CPU seconds by stage
    std::vector<std::pair<std::string, double>> counters;      // rays, links, degenerate events, ...
    std::vector<std::string> warnings;
    double relative_error = 0;  // reached, as defined in Accuracy
    bool target_met = true;
};

}  // namespace gonio
