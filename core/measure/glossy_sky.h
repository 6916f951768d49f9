// The light of an environment on glossy facets, one random run after the other. Every facet looks its lobe up
// at directions that all share (Heidrich et al. 2000, sec. 3.1), where these miss the surface; over the pairs
// of the pair graph the light goes on. Internal to measure/.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "measure/graph_run.h"
#include "measure/report.h"
#include "scattering/environment.h"

namespace gonio {

// Facet parts and where each is seen from, as structure of arrays.
struct SeenParts {
    std::vector<uint32_t> unknown;
    std::vector<float> x, y, z;

    void resize(size_t n);
    void set(size_t k, size_t part, const Vec3& towards);
};
// Any number of them, made a stretch at a time. parts: fills `out` with [first, first + count); thread-safe.
struct Receivers {
    size_t count = 0;
    std::function<void(size_t first, size_t count, SeenParts& out)> parts;
};
using Radiances = std::vector<std::vector<float>>;  // [channel][receiver], in the unit of the environment's

class GlossySky {
  public:
    // azimuths: there are azimuths^2 directions. The references must outlive it. Throws Error: for mirrors,
    // curved bases, RGB light on a spectrum.
    GlossySky(const HeightField& surface, const Material& material, const Environment& environment,
              int azimuths, int max_order, const Accuracy::Samples& samples, uint64_t seed,
              const RunOptions& options, const Monitor& monitor);

    const MarchGrid& grid() const { return grid_; }
    const Tile& tile() const { return tile_; }  // the whole period
    size_t n_channels() const { return materials_.size(); }

    void start_run(int run);
    const std::vector<SubSample>& places() const { return places_; }  // of the run that was started
    // The first order at one of them, inside each part.
    Radiances direct(const SubSample& place, const Receivers& receivers);
    // The orders beyond, evenly from each part. After direct() of every place of the run; from then on both
    // may be asked for other receivers, under the same light.
    Radiances indirect(const Receivers& receivers);

    bool has_indirect() const { return indirect_; }
    double remainder() const { return remainder_; }  // as in GraphOrders: the largest
    // What too few directions of all runs leave of means over the surface at least, [channel][view]; 0 unless
    // lobes are narrow (narrow_lobes.h).
    std::vector<double> undersampled(const std::vector<Vec3>& views, int runs) const;
    void describe(int runs, Report& report) const;
    // Predicted for one run: bytes beside what the receivers take, and CPU seconds.
    static double run_bytes(const HeightField& surface, const Accuracy::Samples& samples, int n_channels);
    static double run_seconds(const HeightField& surface, const Accuracy::Samples& samples, int n_channels,
                              int azimuths, double n_receivers);

  private:
    struct Lit;  // what a few directions give every part
    void add_direct(const Lit& lit, double share, const Receivers& receivers, Radiances& to);
    void sweep();

    Accuracy::Samples samples_;
    uint64_t seed_;
    const RunOptions& options_;
    const Monitor& monitor_;
    int n_directions_, max_order_;
    Environment sky_;
    const HeightField& surface_;
    Material material_;  // in fewest lobes
    MarchGrid grid_;
    Tile tile_;
    GraphContext context_;
    bool indirect_ = false;
    std::vector<SlotMaterial> materials_;     // one a channel
    std::vector<std::vector<size_t>> alike_;  // channels of the same material
    std::vector<SubSample> places_;
    EnvironmentSamples directions_;
    PairGraph graph_;
    Radiances first_;                   // over the pairs: the first order, of the places so far
    std::vector<double> arrived_;       // [channel]: as FirstOrder, of the places so far
    std::vector<HugeFloats> arriving_;  // over the pairs, all orders: [alike][pair][columns]
    double rays_ = 0, pairs_ = 0, truncated_ = 0, remainder_ = 0;
    int orders_ = 0;
};

}  // namespace gonio
