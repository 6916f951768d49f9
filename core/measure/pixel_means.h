// Means over the pixels of the views of a BTF. Internal to measure/.
#pragma once
#include "measure/btf.h"
#include "measure/facet_light.h"

namespace gonio {

class PixelMeans {
  public:
    // The references must outlive it.
    PixelMeans(const BtfShape& shape, const std::vector<uint32_t>& view_maps, const FacetLight& light,
               int n_threads);

    // Of fields of at most column_block columns, [column][view].
    Matrix of(const Fields& fields) const;

    // Of every view: which share of its places shows lower facets (kind 0).
    const std::vector<double>& lower_share() const { return lower_share_; }

  private:
    // Unknowns of a row of places of a view; `room` holds them if they are not the map itself.
    const uint32_t* unknowns(int view, int sample, int row, std::vector<uint32_t>& room) const;

    const BtfShape& shape_;
    const std::vector<uint32_t>& view_maps_;
    const FacetLight& light_;
    int n_threads_;
    std::vector<double> lower_share_;
};

}  // namespace gonio
