#include "clients/plot/table_view.h"

#include <algorithm>

namespace gonio {

std::vector<OutgoingSample> samples_of(const Table& table, int incident, size_t channel) {
    std::vector<OutgoingSample> samples;
    auto add = [&](size_t row, int outgoing) {
        const size_t k = table.index(channel, 0, row);
        samples.push_back({table.outgoing[outgoing], table.f[k], std::hypot(table.se[k], table.bias[k])});
    };
    if (table.pairs.empty()) {
        const size_t n = table.outgoing.size();
        for (size_t o = 0; o < n; ++o) add(incident * n + o, static_cast<int>(o));
    } else {
        for (size_t row = 0; row < table.rows(); ++row)
            if (table.pairs[row].first == incident) add(row, table.pairs[row].second);
    }
    return samples;
}

std::vector<LobeSample> in_plane(const std::vector<OutgoingSample>& samples, const AnglesDeg& wi) {
    constexpr double tolerance_deg = 0.01;
    std::vector<LobeSample> lobe;
    for (const OutgoingSample& s : samples) {
        const double turn = std::abs(std::remainder(s.wo.phi_deg - wi.phi_deg, 360));
        if (s.wo.theta_deg < tolerance_deg) {
            // The pole belongs to every plane; grids hold it once an azimuth.
            if (lobe.empty() ||
                std::none_of(lobe.begin(), lobe.end(), [](const LobeSample& l) { return l.theta_deg == 0; }))
                lobe.push_back({0, s.f, s.error});
        } else if (turn < tolerance_deg) {
            lobe.push_back({-s.wo.theta_deg, s.f, s.error});
        } else if (180 - turn < tolerance_deg) {
            lobe.push_back({s.wo.theta_deg, s.f, s.error});
        }
    }
    std::sort(lobe.begin(), lobe.end(),
              [](const LobeSample& a, const LobeSample& b) { return a.theta_deg < b.theta_deg; });
    return lobe;
}

}  // namespace gonio
