// The light of random runs on glossy facets, and what pixels see of it. Internal to measure/.
#pragma once
#include <vector>

#include "measure/btf.h"
#include "measure/graph_run.h"
#include "measure/narrow_lobes.h"

namespace gonio {

// What one run keeps, and needs beside while it is made.
double glossy_run_bytes(const BtfShape& shape, const Accuracy::Samples& samples, const BaseCurvature& base);

class GlossyPixels {
  public:
    // The references must outlive it. Throws Error.
    GlossyPixels(const HeightField& surface, const Material& material, const BtfPlan& plan,
                 const Accuracy::Samples& samples, const RunOptions& options, const Monitor& monitor);

    const MarchGrid& grid() const { return grid_; }
    int n_runs() const { return static_cast<int>(runs_.size()); }  // that are kept
    bool fits_another() const;                                     // into the working memory
    void add_run();                                                // throws Error(limit) if it does not fit

    // Of `count` pixels of a view from `first` on, L / (E0 cos_i) in 1/sr: [run][pixel][light]. map: the
    // view's, [sample][pixel] as in Btf. Thread-safe.
    std::vector<float> values(const BtfShape& shape, const std::vector<uint32_t>& map, int view, int channel,
                              size_t first, size_t count) const;

    // Of the last run, in units of what a facet that faces the lamp receives: irradiance by the lamp itself,
    // and by light that comes over other facets.
    double direct_irradiance(size_t unknown, size_t light) const {
        return runs_.back().lit.of(unknown)[light];
    }
    double indirect_irradiance(size_t unknown, size_t channel, size_t light) const;
    void forget_runs() { runs_.clear(); }

    double remainder() const { return remainder_; }  // as in GraphOrders: the largest
    // What too few chains of all runs leave of a mean over the pixels, in 1/sr, of which `found` was found
    // with the first order; 0 unless lobes are narrow (narrow_lobes.h).
    double undersampled(size_t channel, size_t light, double found) const;
    bool has_narrow_lobes() const { return static_cast<bool>(narrow_); }
    void describe(Report& report) const;

  private:
    struct Run {
        VisibleCosines lit;  // [unknown][light]
        PairGraph graph;
        std::vector<std::vector<HugeFloats>> arriving;  // [channel][block of lights]
    };
    std::vector<Vec3> lights_of(size_t block) const;
    // Towards the viewer, in the frame of the facet on a slot.
    Vec3 view_of(int view, size_t slot) const;
    // Factor of the light that arrives over each pair of the facets, in their order, on its way to a view.
    void add_pair_weights(const Run& run, int channel, const Vec3& view, const uint32_t* unknowns, size_t n,
                          std::vector<float>& weights) const;

    const HeightField& surface_;
    const BtfPlan& plan_;
    Accuracy::Samples samples_;
    const RunOptions& options_;
    const Monitor& monitor_;
    MarchGrid grid_;
    Tile tile_;
    GraphContext context_;
    Material material_;
    std::vector<SlotMaterial> materials_;  // one a channel
    std::vector<Vec3> lights_;
    size_t lights_at_once_ = 64;
    std::vector<DirectionArrays> light_blocks_;  // of so many lights
    std::vector<Vec3> cameras_;
    double plane_height_ = 0;
    std::vector<float> facet_heights_;  // per slot, on a curved base
    double run_bytes_ = 0;
    int started_runs_ = 0;
    std::vector<Run> runs_;
    NarrowLobes narrow_;
    LaterLight later_;  // if there are such
    double rays_ = 0, pairs_ = 0, truncated_ = 0, remainder_ = 0;
    int orders_ = 0;
};

}  // namespace gonio
