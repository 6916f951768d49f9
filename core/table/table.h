// What a measurement gives: values with their doubt, and where they come from.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "directions/cells.h"
#include "directions/direction.h"

namespace gonio {

// One row per pair (incident, outgoing). f is the BRDF f_r in 1/sr, no cosine inside. se is the standard error (one sigma) of the
// randomised runs, bias the estimate of what they cannot see (mesh, truncated orders); both absolute, in 1/sr, >= 0.
struct Table {
    std::vector<AnglesDeg> incident, outgoing;  // unique directions, in the order of the job
    // Empty: the full product, row = i * outgoing.size() + o. Else row r is (incident[pairs[r].first], outgoing[pairs[r].second]).
    std::vector<std::pair<int, int>> pairs;
    // Not empty: outgoing[o] is the centre of the receiver cells[o], and f the mean over it weighted by the cosine: cell flux /
    // (E0 * projected solid angle).
    std::vector<ReceiverCell> cells;
    std::vector<std::string> channels;          // "y", "r", ..., "450nm"
    // orders == 0: only the sum of all orders. orders == K: slices 0..K, slice 0 the sum of all, slice k the k-th order alone.
    int orders = 0;
    std::vector<float> f, se, bias;             // each [channel][slice][row]
    // Job hash, surface hash, program version, seed, settings chosen, ...: written into every file, keys in this order.
    std::vector<std::pair<std::string, std::string>> provenance;

    size_t rows() const { return pairs.empty() ? incident.size() * outgoing.size() : pairs.size(); }
    size_t slices() const { return static_cast<size_t>(orders) + 1; }
    size_t index(size_t channel, size_t slice, size_t row) const { return (channel * slices() + slice) * rows() + row; }
    std::pair<int, int> pair(size_t row) const {
        if (!pairs.empty()) return pairs[row];
        return {static_cast<int>(row / outgoing.size()), static_cast<int>(row % outgoing.size())};
    }
};

}  // namespace gonio
