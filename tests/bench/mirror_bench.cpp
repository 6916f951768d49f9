// Mirrors by forward tracing against photons on Embree, and the grid tracer against Embree's packets: one
// thread, CPU time, the error beside it. Gaussian field N = 128, correlation length 8 cells, 64 lights, 64
// cells of equal projected solid angle.
#include <embree3/rtcore.h>

#include <algorithm>
#include <cstdio>
#include <numeric>

#include "base/random.h"
#include "measure/run.h"
#include "scattering/forward.h"
#include "tests/agreement/photons.h"
#include "tests/bench/bench.h"
#include "tests/bench/tiled_scene.h"
#include "visibility/march.h"

using namespace gonio;

namespace {

constexpr int n_cells = 64;

std::vector<Vec3> lights() {
    std::vector<Vec3> list;
    for (const AnglesDeg& a : bench::sixty_four_directions()) list.push_back(to_vector(a));
    return list;
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

// The rays that a mirror relief sends off its lit facets, light after light, as the forward tracer batches
// them.
std::vector<RayBatch> reflected_rays(const HeightField& s, const TraceGrid& grid) {
    const MarchGrid march = make_march_grid(s);
    std::vector<RayBatch> batches;
    for (const Vec3& light : lights())
        for (int kind = 0; kind < 2; ++kind) {
            RayBatch rays;
            rays.reserve(static_cast<size_t>(s.nx) * s.ny);
            const FacetPoint p = facet_point(kind, 0.3, 0.7);
            std::vector<uint32_t> bits(static_cast<size_t>(words_for(s.nx)) * s.ny);
            march_visible(march, make_ray_bundle(march, light, p, max_march_travel), {0, 0, s.nx, s.ny},
                          bits.data());
            for (int j = 0; j < s.ny; ++j)
                for (int i = 0; i < s.nx; ++i) {
                    if (!(bits[static_cast<size_t>(j) * words_for(s.nx) + i / 32] >> (i % 32) & 1)) continue;
                    const Gradient g = facet_gradient(s, kind, i, j);
                    const double ratio = area_ratio(g);
                    const Vec3 n{-g.x / ratio, -g.y / ratio, 1 / ratio};
                    const double twice = 2 * dot(n, light);
                    const auto u = static_cast<float>(p.u), v = static_cast<float>(p.v);
                    rays.add(grid, i, j, u, v, facet_height(grid, kind, i, j, u, v),
                             {twice * n.x - light.x, twice * n.y - light.y, twice * n.z - light.z}, 0);
                }
            batches.push_back(std::move(rays));
        }
    return batches;
}

// Hits of all rays by packets of one width; prepares a packet from the arrays as a careful user would.
template <class Packet, int kWidth, class Trace>
long long packets(const std::vector<RayBatch>& batches, Trace&& trace) {
    long long hits = 0;
    Packet packet;
    alignas(64) int valid[kWidth];
    for (const RayBatch& b : batches)
        for (size_t first = 0; first < b.n; first += kWidth) {
            const int lanes = static_cast<int>(std::min<size_t>(kWidth, b.n - first));
            auto& ray = packet.ray;
            for (int k = 0; k < kWidth; ++k) {
                const size_t at = first + std::min(k, lanes - 1);
                valid[k] = k < lanes ? -1 : 0;
                ray.org_x[k] = static_cast<float>(b.i[at]) + b.u[at];
                ray.org_y[k] = static_cast<float>(b.j[at]) + b.v[at];
                ray.org_z[k] = b.z[at];
                ray.dir_x[k] = b.dx[at], ray.dir_y[k] = b.dy[at], ray.dir_z[k] = b.dz[at];
                ray.tnear[k] = 1e-3f, ray.tfar[k] = 1e30f, ray.time[k] = 0;
                ray.mask[k] = ~0u, ray.id[k] = 0, ray.flags[k] = 0;
                packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
                packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
            }
            trace(valid, packet);
            for (int k = 0; k < lanes; ++k) hits += packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
        }
    return hits;
}

void compare_tracers(double slope) {
    const HeightField s = bench::field(128, slope);
    const TraceGrid grid = make_trace_grid(s);
    const bench::TiledScene scene(s);
    const std::vector<RayBatch> rays = reflected_rays(s, grid);
    size_t n = 0, most = 0;
    for (const RayBatch& b : rays) n += b.n, most = std::max(most, b.n);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    long long embree_hits = 0;
    std::vector<double> embree;
    struct Row {
        const char* target;
        std::vector<double> seconds;
        long long hits = 0;
    };
    std::vector<Row> rows{{"AVX3", {}, 0}, {"AVX2", {}, 0}, {"SSE4", {}, 0}};
    RayBatch hits, escaped;
    hits.reserve(most);
    escaped.reserve(most);
    std::vector<int32_t> lost;
    for (int repeat = 0; repeat < 5; ++repeat) {
        double begin = bench::cpu_seconds();
        embree_hits = packets<RTCRayHit8, 8>(
            rays, [&](const int* valid, RTCRayHit8& r) { rtcIntersect8(valid, scene.scene, &context, &r); });
        const double by_8 = bench::cpu_seconds() - begin;
        begin = bench::cpu_seconds();
        packets<RTCRayHit16, 16>(rays, [&](const int* valid, RTCRayHit16& r) {
            rtcIntersect16(valid, scene.scene, &context, &r);
        });
        embree.push_back(std::min(by_8, bench::cpu_seconds() - begin));
        for (Row& row : rows) {
            if (!force_simd_target(row.target)) continue;
            row.hits = 0;
            double seconds = 0;
            for (const RayBatch& b : rays) {
                RayBatch copy = b;  // tracing uses the rays up
                begin = bench::cpu_seconds();
                trace_rays(grid, copy, hits, escaped, lost);
                seconds += bench::cpu_seconds() - begin;
                row.hits += static_cast<long long>(hits.n);
            }
            row.seconds.push_back(seconds);
        }
        force_simd_target("");
    }
    const double count = static_cast<double>(n);
    for (const Row& row : rows)
        if (!row.seconds.empty())
            std::printf("tracer,%.1f,%s,%.1f,%.1f,%.2f,%.1f\n", slope, row.target,
                        1e9 * median(row.seconds) / count, 1e9 * median(embree) / count,
                        median(embree) / median(row.seconds),
                        1e6 * std::abs(static_cast<double>(row.hits - embree_hits)) / count);
}

using Shares = std::vector<std::vector<double>>;  // [light][cell], all orders

// Rms relative error over the cells that hold 99 % of each light's energy.
double error_of(const Shares& found, const Shares& truth) {
    double sum = 0;
    size_t n = 0;
    for (size_t l = 0; l < truth.size(); ++l) {
        std::vector<int> order(n_cells);
        std::iota(order.begin(), order.end(), 0);
        std::sort(order.begin(), order.end(), [&](int a, int b) { return truth[l][a] > truth[l][b]; });
        double held = 0;
        for (int k = 0; k < n_cells && held < 0.99; ++k, ++n) {
            const double f = truth[l][order[k]];
            held += f;
            sum += std::pow(found[l][order[k]] / f - 1, 2);
        }
    }
    return std::sqrt(sum / static_cast<double>(n));
}

Shares forward(const ForwardScene& scene, int sub_samples, uint64_t stream) {
    Shares shares;
    int number = 0;
    for (const Vec3& light : lights()) {
        const auto words = random_words(5, stream, number);
        ForwardSettings settings;
        settings.sub_samples =
            shifted_sub_samples(sub_samples, uniform_double(words[0]), uniform_double(words[1]));
        const ForwardTally tally = trace_light(scene, light, settings, 5, stream, number++, {});
        shares.emplace_back(n_cells, 0.0);
        for (const std::vector<double>& order : tally.share)
            for (int cell = 0; cell < n_cells; ++cell) shares.back()[cell] += order[cell];
    }
    return shares;
}

Shares by_photons(const PhotonTracer& tracer, int strata, uint64_t stream) {
    Shares shares;
    for (const Vec3& light : lights()) {
        const Photons photons = tracer.trace(light, strata, 64 * stream + shares.size());
        shares.emplace_back(n_cells, 0.0);
        for (const std::vector<double>& order : photons.share)
            for (int cell = 0; cell < n_cells; ++cell) shares.back()[cell] += order[cell];
    }
    return shares;
}

void compare_tables(double slope, int truth_sub_samples) {
    const HeightField s = bench::field(128, slope);
    const std::vector<ReceiverCell> cells = equal_cells(n_cells);
    const Material mirror{{"y"}, Mirror{{{1.0}, {}, {}}}};
    const MarchGrid march = make_march_grid(s);
    const ForwardScene scene(s, march, mirror, cells);
    const Shares truth = forward(scene, truth_sub_samples, 1000);
    struct Result {
        double seconds, error;
    };
    const auto mean_of = [&](int repeats, auto&& make) {
        Result r{0, 0};
        for (int k = 0; k < repeats; ++k) {
            const double begin = bench::cpu_seconds();
            const Shares shares = make(k);
            r.seconds += (bench::cpu_seconds() - begin) / repeats;
            r.error += std::pow(error_of(shares, truth), 2) / repeats;
        }
        r.error = std::sqrt(r.error);
        return r;
    };
    const PhotonTracer photons(s, cells);
    Result rival[2];
    const int strata[2] = {128, 256};
    for (int k = 0; k < 2; ++k) {
        rival[k] =
            mean_of(k == 0 ? 4 : 2, [&](int run) { return by_photons(photons, strata[k], 10 * k + run); });
        std::printf("photons,%.1f,%d per light,%.3f,%.3f %%\n", slope, strata[k] * strata[k],
                    rival[k].seconds, 100 * rival[k].error);
    }
    // Stratified photons converge faster than n^-1/2: their time is carried to an error by their own slope.
    const double exponent =
        std::log(rival[1].seconds / rival[0].seconds) / std::log(rival[1].error / rival[0].error);
    for (const int sub_samples : {1, 2, 4}) {
        const Result r = mean_of(4, [&](int run) { return forward(scene, sub_samples, run); });
        const double photon_seconds = rival[1].seconds * std::pow(r.error / rival[1].error, exponent);
        std::printf("forward,%.1f,%d sub-samples,%.3f,%.3f %%,photons at that error %.2f s,ratio %.1f\n",
                    slope, sub_samples, r.seconds, 100 * r.error, photon_seconds, photon_seconds / r.seconds);
    }
}

}  // namespace

int main() {
    std::setvbuf(stdout, nullptr, _IOLBF, 0);  // it takes minutes
    std::printf(
        "# grid tracer against Embree %s packets on reflected rays, CPU ns a ray, median of 5 interleaved\n",
        RTC_VERSION_STRING);
    std::printf("what,slope,target,ns,embree_ns,ratio,disagree_ppm\n");
    for (const double slope : {0.5, 0.7}) compare_tracers(slope);
    std::printf(
        "# 64 lights x 64 cells of a perfect mirror, CPU seconds; rms relative error over the cells of 99 %% "
        "of the "
        "energy\nwhat,slope,effort,cpu_s,error\n");
    compare_tables(0.5, 64);
    compare_tables(0.7, 64);
}
