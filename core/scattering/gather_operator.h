// The diffuse transport operator as pictures of a relief want it: light is summed where it arrives, so every
// facet part lists what it sees. Of two operators that take turns, none meets its own noise.
#pragma once
#include <vector>

#include "scattering/fields.h"
#include "scattering/link_operator.h"
#include "scattering/tile.h"

namespace gonio {

// (K x)[u] = sum over links [begin[u], begin[u + 1]) of weight x[seen], x an irradiance: not scaled by
// sqrt(area), unlike LinkOperator, whose links it holds in both senses.
struct GatherOperator {
    std::vector<uint32_t> begin;  // n_unknowns + 1
    std::vector<Link> links;
};

GatherOperator gather_operator(const LinkOperator& op, const Tile& tile);

// Of exitance where x is an irradiance: every link times the albedo of what is seen. albedo: one per slot.
GatherOperator weighed_by(GatherOperator op, const Tile& tile, const std::vector<float>& albedo);

// Few columns side by side, [unknown][n_columns]: Fields would carry 32 whatever is asked for.
struct FewColumns {
    static constexpr int most = 4;
    int n_columns = 0;
    std::vector<float> values;
};

// Where K x is added to, times `factor`.
template <class Columns>
struct GatherSum {
    Columns* columns;
    float factor;
};

// y = K x. The same bits for any number of threads.
void gather(const GatherOperator& op, const Tile& tile, const Fields& x, Fields& y,
            const std::vector<GatherSum<Fields>>& sums, int n_threads);
void gather(const GatherOperator& op, const Tile& tile, const FewColumns& x, FewColumns& y,
            const std::vector<GatherSum<FewColumns>>& sums, int n_threads);

}  // namespace gonio
