// What the two halves of the figure of a table ask of it. Slice 0, the sum of all orders, is what is drawn.
#pragma once
#include <cmath>
#include <string>
#include <vector>

#include "table/table.h"

namespace gonio {

struct OutgoingSample {
    AnglesDeg wo;
    double f = 0, error = 0;  // error = sqrt(se^2 + bias^2), 1/sr
};

// Every outgoing sample of one incident direction.
std::vector<OutgoingSample> samples_of(const Table& table, int incident, size_t channel);

struct LobeSample {
    double theta_deg = 0;  // signed: negative on the side of the light
    double f = 0, error = 0;
};

// Samples in the plane of incidence, by signed theta.
std::vector<LobeSample> in_plane(const std::vector<OutgoingSample>& samples, const AnglesDeg& wi);

inline std::string provenance_value(const Table& table, const std::string& key) {
    for (const auto& [k, value] : table.provenance)
        if (k == key) return value;
    return {};
}

}  // namespace gonio
