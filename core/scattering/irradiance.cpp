#include "scattering/irradiance.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/parallel.h"
#include "scattering/kernels.h"
#include "visibility/corrected_horizon.h"
#include "visibility/march.h"

namespace gonio {
namespace {

struct RayCounts {
    std::atomic<long long> marched{0}, skipped{0};
    std::atomic<int> truncated{0};
};

// Irradiance factors of all parts for one sub-sample: march 32 directions, then turn their bits into cosines.
void expand_directions(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& directions,
                       const SubSample& sample, bool skip_steep, int n_threads, const Monitor& monitor,
                       Fields& out, RayCounts& counts) {
    const size_t words_per_kind = static_cast<size_t>(words_for(tile.area.width)) * tile.area.height,
                 words = 2 * words_per_kind;
    std::vector<uint32_t> bits(column_block * words);
    for (int block = 0; block < out.n_blocks(); ++block) {
        const int first = block * column_block,
                  n = std::min(column_block, static_cast<int>(directions.size()) - first);
        DirectionBlock columns;
        for (int c = 0; c < n; ++c) {
            columns.x[c] = static_cast<float>(directions[first + c].x);
            columns.y[c] = static_cast<float>(directions[first + c].y);
            columns.z[c] = static_cast<float>(directions[first + c].z);
        }
        for (int part = 0; part < tile.n_parts(); ++part) {
            monitor.check_cancelled();
            parallel_for(2 * column_block, n_threads, [&](int task) {
                const int c = task / 2, kind = task % 2;
                uint32_t* to = &bits[c * words + kind * words_per_kind];
                if (c >= n) {
                    std::fill_n(to, words_per_kind, 0u);
                    return;
                }
                const Vec3& d = directions[first + c];
                const long long rays = static_cast<long long>(tile.area.width) * tile.area.height;
                if (skip_steep && d.z > grid.max_slope * std::hypot(d.x, d.y)) {
                    std::fill_n(to, words_per_kind,
                                ~0u);  // lit wherever it faces the light; the cosine knows that
                    counts.skipped += rays;
                    return;
                }
                const FacetPoint point = facet_point(kind, sample.a, sample.b, tile.refinement, part);
                counts.marched += rays;
                counts.truncated += visible_on_base(grid, d, point, max_march_travel, tile.area, to);
            });
            constexpr size_t chunk = 1024;
            float* to = out.block(block) + part * tile.n_slots() * column_block;
            const int n_chunks = static_cast<int>((tile.n_slots() + chunk - 1) / chunk);
            parallel_for(n_chunks, n_threads, [&](int k) {
                const size_t begin = k * chunk, count = std::min(chunk, tile.n_slots() - begin);
                expand_visible(columns, bits.data(), words, begin, count, tile.normal_x.data(),
                               tile.normal_y.data(), tile.normal_z.data(), tile.sqrt_area.data(), to);
            });
        }
    }
}

void add_projected_area(const Tile& tile, const Fields& fields, double scale, std::vector<double>& sums) {
    for (int block = 0; block < fields.n_blocks(); ++block) {
        double total[column_block] = {};
        for (int part = 0; part < tile.n_parts(); ++part)
            for (const Tile::Run& run : tile.core_runs()) {
                // Float lanes over few slots, then double: every value of the table is divided by these sums.
                for (size_t begin = run.first; begin < run.first + run.count; begin += 16) {
                    float lanes[column_block] = {};
                    for (size_t s = begin; s < std::min(begin + 16, run.first + run.count); ++s) {
                        const float* row = fields.block(block) + (part * tile.n_slots() + s) * column_block;
                        for (int c = 0; c < column_block; ++c) lanes[c] += tile.sqrt_area[s] * row[c];
                    }
                    for (int c = 0; c < column_block; ++c) total[c] += lanes[c];
                }
            }
        for (int c = 0; c < column_block && block * column_block + c < static_cast<int>(sums.size()); ++c)
            sums[block * column_block + c] += scale * total[c];
    }
}

Fields zero_fields(size_t n_unknowns, int n_columns) {
    Fields fields(n_unknowns, n_columns);
    std::fill(fields.values().begin(), fields.values().end(), 0.0f);
    return fields;
}

void add_scaled(const Fields& from, float scale, int n_threads, Fields& to) {
    constexpr size_t chunk = 1 << 16;
    const size_t size = to.values().size();
    parallel_for(static_cast<int>((size + chunk - 1) / chunk), n_threads, [&](int k) {
        for (size_t i = k * chunk; i < std::min(size, (k + 1) * chunk); ++i)
            to.values()[i] += scale * from.values()[i];
    });
}

}  // namespace

void scale_rows(Fields& fields, const Tile& tile, const ChannelFactors& factors, int n_threads) {
    constexpr size_t chunk = 4096;
    const int n_chunks = static_cast<int>((fields.n_unknowns() + chunk - 1) / chunk);
    parallel_for(n_chunks, n_threads, [&](int k) {
        for (int block = 0; block < fields.n_blocks(); ++block)
            for (size_t u = k * chunk; u < std::min(fields.n_unknowns(), (k + 1) * chunk); ++u) {
                float* row = fields.block(block) + u * column_block;
                for (int c = 0; c < column_block; ++c) row[c] *= factors[u % tile.n_slots()];
            }
    });
}

Irradiance compute_irradiance(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                              const std::vector<Vec3>& views, bool same_directions,
                              const std::vector<SubSample>& sub_samples,
                              const std::vector<ChannelFactors>& channels, bool skip_steep, int n_threads,
                              const Monitor& monitor) {
    Irradiance result;
    result.same_directions = same_directions;
    const int n_lights = static_cast<int>(lights.size()), n_views = static_cast<int>(views.size());
    result.direct.assign(std::max<size_t>(1, channels.size()), Matrix(n_lights, n_views));
    result.projected_lights.assign(n_lights, 0.0);
    result.projected_views.assign(n_views, 0.0);
    RayCounts counts;
    const double share = 1.0 / static_cast<double>(sub_samples.size());

    Fields sample_lights(tile.n_unknowns(), n_lights), sample_views;
    if (!same_directions) sample_views = Fields(tile.n_unknowns(), n_views);
    if (sub_samples.size() > 1) {
        result.lights = zero_fields(tile.n_unknowns(), n_lights);
        if (!same_directions) result.views = zero_fields(tile.n_unknowns(), n_views);
    }
    auto add_direct = [&](const Fields& of_lights, const Fields& of_views, Matrix& sum) {
        const Combination a{{&of_lights, 1}}, b{{&of_views, 1}};
        add_products(tile, a, same_directions ? a : b, share, n_threads, sum);
    };
    for (const SubSample& sample : sub_samples) {
        expand_directions(grid, tile, lights, sample, skip_steep, n_threads, monitor, sample_lights, counts);
        add_projected_area(tile, sample_lights, share, result.projected_lights);
        if (!same_directions) {
            expand_directions(grid, tile, views, sample, skip_steep, n_threads, monitor, sample_views,
                              counts);
            add_projected_area(tile, sample_views, share, result.projected_views);
        }
        if (channels.empty()) {
            add_direct(sample_lights, sample_views, result.direct[0]);
        } else {
            for (size_t c = 0; c < channels.size();
                 ++c) {  // albedo belongs to one side: both sides carry its root
                Fields scaled_lights = sample_lights, scaled_views = sample_views;
                scale_rows(scaled_lights, tile, channels[c], n_threads);
                if (!same_directions) scale_rows(scaled_views, tile, channels[c], n_threads);
                add_direct(scaled_lights, scaled_views, result.direct[c]);
            }
        }
        if (sub_samples.size() > 1) {
            add_scaled(sample_lights, static_cast<float>(share), n_threads, result.lights);
            if (!same_directions)
                add_scaled(sample_views, static_cast<float>(share), n_threads, result.views);
        }
    }
    if (sub_samples.size() == 1) {
        result.lights = std::move(sample_lights);
        result.views = std::move(sample_views);
    }
    if (same_directions) result.projected_views = result.projected_lights;
    result.rays = static_cast<double>(counts.marched);
    result.rays_skipped = static_cast<double>(counts.skipped);
    result.truncated_bundles = counts.truncated;
    return result;
}

LightIrradiance light_irradiance(const MarchGrid& grid, const Tile& tile, const std::vector<Vec3>& lights,
                                 const std::vector<SubSample>& sub_samples, bool skip_steep, int n_threads,
                                 const Monitor& monitor) {
    LightIrradiance result;
    RayCounts counts;
    const int n_lights = static_cast<int>(lights.size());
    Fields sample(tile.n_unknowns(), n_lights);
    if (sub_samples.size() > 1) result.lights = zero_fields(tile.n_unknowns(), n_lights);
    for (const SubSample& place : sub_samples) {
        expand_directions(grid, tile, lights, place, skip_steep, n_threads, monitor, sample, counts);
        if (sub_samples.size() > 1)
            add_scaled(sample, 1.0f / static_cast<float>(sub_samples.size()), n_threads, result.lights);
    }
    if (sub_samples.size() == 1) result.lights = std::move(sample);
    result.rays = static_cast<double>(counts.marched);
    result.rays_skipped = static_cast<double>(counts.skipped);
    result.truncated_bundles = counts.truncated;
    return result;
}

}  // namespace gonio
