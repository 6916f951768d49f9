// BTFs and light fields of glossy facets: what a facet sends back depends on the view, so there is no
// factored form, and pictures are made view by view, never all in memory. The first order is exact for a flat
// facet, but for what is lit inside it; the others come over the pairs of the pair graph.
#pragma once
#include <functional>
#include <memory>
#include <span>

#include "measure/btf.h"

namespace gonio {

class GlossyBtf {
  public:
    // All but the pictures: the light of as many random runs as the accuracy needs, judged by a few views.
    // The references must outlive it. Throws Error: for mirrors, and for cameras over curved bases; limit;
    // cancelled.
    GlossyBtf(const HeightField& surface, const Material& material, const BtfPlan& plan,
              const RunOptions& options, const Monitor& monitor);
    ~GlossyBtf();

    const BtfShape& shape() const;
    const Report& report() const;

    // Calls on_view for one view after the other with images [light][channel][pixel], halves as in
    // expand_view. Returns `mean` and `pixel_se`, the latter over the pixels of all views; radiance and
    // view_maps stay empty.
    Btf pictures(const std::function<void(int view, std::span<const uint16_t> images)>& on_view);

  private:
    class Measurement;
    std::unique_ptr<Measurement> measurement_;
};

// As predict_btf, which asks it for whatever is not Lambertian.
Prediction predict_glossy_btf(const HeightField& surface, const Material& material, const BtfPlan& plan);

}  // namespace gonio
