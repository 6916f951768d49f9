#include "measure/narrow_lobes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "base/random.h"
#include "material/lobe_shape.h"
#include "measure/graph_run.h"
#include "scattering/forward.h"

namespace gonio {
namespace {

constexpr int block_cells = 32;  // of ForwardSettings::block_step
constexpr double rays_in_all = 1 << 19;

// Above all counters that runs draw from, of a stage that there is not.
constexpr uint64_t stream = uint64_t{1} << 52;

// Share of the light of order k + 2 that has met a narrow lobe.
double narrow_share(const NarrowLobes& lobes, size_t k) {
    return 1 - std::pow(1 - lobes.share, static_cast<double>(k) + 2);
}

}  // namespace

NarrowLobes narrower_lobes(const Material& material, double solid_angle) {
    NarrowLobes narrow;
    for (const LobeShape& shape : lobe_shapes(material)) {
        const double of_shape = 4 * pi * shape.width * shape.width;
        // What little a lobe reflects in all is spread as thinly as by a wider one.
        if (of_shape >= solid_angle * shape.share) continue;
        narrow.share += shape.share / reflected_share(material);
        narrow.solid_angle = std::min(narrow.solid_angle, of_shape);
    }
    return narrow;
}

NarrowLobes narrow_lobes(const Material& material, const MarchGrid& grid, const Tile& tile,
                         int n_directions) {
    const double peak = highest_peak(material);
    if (!(peak > 0)) return {};
    const double slope = grid.max_slope, slab = 4 * pi * slope / std::sqrt(1 + slope * slope),
                 pair = lobe_share_of_pair(material, grid, tile, n_directions) / peak;
    NarrowLobes narrow = narrower_lobes(material, pair / narrow_share_of_pair);
    narrow.chance_of_pair = std::min(1.0, narrow.solid_angle / slab);
    return narrow;
}

LaterLight trace_later_light(const HeightField& surface, const Material& material,
                             const std::vector<Vec3>& lights, int max_order, uint64_t seed, int n_threads,
                             const Monitor& monitor) {
    std::optional<HeightField> flat;
    if (surface.base.is_curved()) {
        flat = surface;
        flat->base = {};
    }
    const HeightField& relief = flat ? *flat : surface;
    const MarchGrid grid = make_march_grid(relief);
    const std::vector<ReceiverCell> sky = equal_cells(1);
    const ForwardScene scene(relief, grid, material, sky);
    const double blocks = std::ceil(1.0 * (relief.nx - 2 * relief.border_x) / block_cells) *
                          std::ceil(1.0 * (relief.ny - 2 * relief.border_y) / block_cells),
                 rays = 2.0 * block_cells * block_cells * blocks * static_cast<double>(lights.size());
    LaterLight later(lights.size());
    parallel_for(static_cast<int>(lights.size()), n_threads, [&](int l) {
        const auto words = random_words(seed, stream, static_cast<uint64_t>(l));
        ForwardSettings settings;
        settings.sub_samples = {{uniform_double(words[0]), uniform_double(words[1])}};
        settings.block_step = static_cast<int>(std::clamp(rays / rays_in_all, 1.0, blocks));
        settings.first_block = static_cast<int>(words[2] % static_cast<uint32_t>(settings.block_step));
        settings.max_order = max_order;
        const ForwardTally tally = trace_light(scene, lights[l], settings, seed, stream, l, monitor);
        later[l].resize(material.channels.size());
        for (size_t c = 0; c < later[l].size(); ++c)
            for (size_t k = 1; k < tally.share.size(); ++k) later[l][c].push_back(tally.share[k][c]);
    });
    return later;
}

std::vector<double> chains_of_pairs(const NarrowLobes& lobes, const std::vector<double>& later, double pairs,
                                    double facets) {
    std::vector<double> chains(later.size());
    // Over a pair from inside the lobe of the light, and on inside that of the facet where it ends.
    double n = pairs * lobes.chance_of_pair * std::min(1.0, lobes.solid_angle / (2 * pi));
    for (double& of_order : chains) {
        of_order = n;
        n *= std::min(1.0, pairs / facets * lobes.chance_of_pair);
    }
    return chains;
}

std::vector<double> chains_of_rays(const NarrowLobes& lobes, const std::vector<double>& later, double rays) {
    std::vector<double> chains(later.size());
    double hits = 0;  // a ray is counted at every facet that it meets
    for (size_t k = later.size(); k-- > 0;) {
        hits += rays * later[k];
        chains[k] = hits * std::min(1.0, lobes.solid_angle / (2 * pi));
    }
    return chains;
}

double undersampled(const NarrowLobes& lobes, const std::vector<double>& later,
                    const std::vector<double>& chains, int order, double found) {
    const auto wanted = [&](size_t k) { return order == 0 || order == static_cast<int>(k) + 2; };
    double mean = 0, squares = 0;
    for (size_t k = 0; k < later.size(); ++k)
        if (wanted(k)) mean += later[k] / pi;
    const double brightness = mean > 0 ? found / mean : 0.0;
    for (size_t k = 0; k < later.size(); ++k)
        if (wanted(k))
            squares += std::pow(narrow_share(lobes, k) * later[k] / pi / (1 + chains[k]), 2) *
                       (1 + brightness * chains[k]);
    return std::sqrt(squares);
}

}  // namespace gonio
