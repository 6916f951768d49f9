// BTFs and light fields of glossy facets: what a facet sends back depends on the view, so there is no
// factored form, and pictures are made view by view, never all in memory. The first order is exact for a flat
// facet, but for what is lit inside it; the others come over the pairs of the pair graph.
#pragma once
#include <functional>
#include <memory>
#include <span>

#include "measure/btf.h"

namespace gonio {

class GlossyPictures {
  public:
    using OnView = std::function<void(int view, std::span<const uint16_t> images)>;
    virtual ~GlossyPictures() = default;
    virtual const BtfShape& shape() const = 0;
    virtual const Report& report() const = 0;
    virtual Btf pictures(const OnView& on_view) = 0;
};

class GlossyBtf {
  public:
    // All but the pictures: the light of as many random runs as the accuracy needs, judged by a few views.
    // environment: as of measure_btf. The references must outlive it.
    // Throws Error: for mirrors, for cameras over curved bases, and for an environment on one; limit;
    // cancelled.
    GlossyBtf(const HeightField& surface, const Material& material, const BtfPlan& plan,
              const RunOptions& options, const Monitor& monitor, const Environment* environment = nullptr);

    const BtfShape& shape() const { return pictures_->shape(); }
    const Report& report() const { return pictures_->report(); }

    // Calls on_view for one view after the other with images [light][channel][pixel], halves as in
    // expand_view. Returns `mean` and `pixel_se`, the latter over the pixels of all views; radiance and
    // view_maps stay empty.
    Btf pictures(const GlossyPictures::OnView& on_view) { return pictures_->pictures(on_view); }

  private:
    std::unique_ptr<GlossyPictures> pictures_;
};

// As predict_btf, which asks it for whatever is not Lambertian.
Prediction predict_glossy_btf(const HeightField& surface, const Material& material, const BtfPlan& plan);

}  // namespace gonio
