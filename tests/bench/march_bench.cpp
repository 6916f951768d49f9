// The lockstep march against Embree's packets: the same rays, one thread, interleaved, CPU time. Prints
// nanoseconds per facet (facets that face away included), the ratio, and how many of the hits disagree (the
// error).
#include <embree3/rtcore.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <vector>

#include "surface/facet_mesh.h"
#include "tests/bench/bench.h"
#include "tests/bench/tiled_scene.h"
#include "visibility/march.h"

using namespace gonio;

namespace {

enum class Call { intersect8, occluded8, intersect16, occluded16 };

// All front-facing rays of one facet kind and direction by one packet call; returns the number that hit.
template <class Packet, int kWidth, class Trace>
long long trace_packets(const HeightField& s, const Vec3& d, const FacetPoint& p, Trace&& trace) {
    long long hits = 0;
    alignas(64) int valid[kWidth];
    Packet packet;
    auto& ray = packet.ray;
    int lane = 0;
    auto flush = [&] {
        if (lane == 0) return;
        for (int k = 0; k < kWidth; ++k) valid[k] = k < lane ? -1 : 0;
        hits += trace(valid, packet, lane);
        lane = 0;
    };
    for (int j = 0; j < s.ny; ++j)
        for (int i = 0; i < s.nx; ++i) {
            const Gradient g = facet_gradient(s, p.kind, i, j);
            if (d.z - g.x * d.x - g.y * d.y <= 0) continue;
            const double h = s.at(i, j) / s.pitch_x + g.x * p.u + g.y * p.v;
            ray.org_x[lane] = static_cast<float>(i + p.u);
            ray.org_y[lane] = static_cast<float>(j + p.v);
            ray.org_z[lane] = static_cast<float>(h);
            ray.dir_x[lane] = static_cast<float>(d.x);
            ray.dir_y[lane] = static_cast<float>(d.y);
            ray.dir_z[lane] = static_cast<float>(d.z);
            ray.tnear[lane] = 2e-3f;
            ray.tfar[lane] = 1e30f;
            ray.time[lane] = 0;
            ray.mask[lane] = ~0u;
            ray.id[lane] = 0;
            ray.flags[lane] = 0;
            if (++lane == kWidth) flush();
        }
    flush();
    return hits;
}

struct OccludedPacket8 {
    RTCRay8 ray;
};
struct OccludedPacket16 {
    RTCRay16 ray;
};

long long embree(const bench::TiledScene& scene, const HeightField& s, const Vec3& d, const FacetPoint& p,
                 Call call) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    auto count_ids = [](const unsigned* ids, int lanes) {
        return std::count_if(ids, ids + lanes, [](unsigned id) { return id != RTC_INVALID_GEOMETRY_ID; });
    };
    auto count_tfar = [](const float* tfar, int lanes) {
        return std::count_if(tfar, tfar + lanes, [](float t) { return t < 0; });
    };
    switch (call) {
        case Call::intersect8:
            return trace_packets<RTCRayHit8, 8>(s, d, p, [&](const int* valid, RTCRayHit8& r, int lanes) {
                std::fill_n(r.hit.geomID, 8, RTC_INVALID_GEOMETRY_ID);
                rtcIntersect8(valid, scene.scene, &context, &r);
                return count_ids(r.hit.geomID, lanes);
            });
        case Call::intersect16:
            return trace_packets<RTCRayHit16, 16>(s, d, p, [&](const int* valid, RTCRayHit16& r, int lanes) {
                std::fill_n(r.hit.geomID, 16, RTC_INVALID_GEOMETRY_ID);
                rtcIntersect16(valid, scene.scene, &context, &r);
                return count_ids(r.hit.geomID, lanes);
            });
        case Call::occluded8:
            return trace_packets<OccludedPacket8, 8>(s, d, p,
                                                     [&](const int* valid, OccludedPacket8& r, int lanes) {
                                                         rtcOccluded8(valid, scene.scene, &context, &r.ray);
                                                         return count_tfar(r.ray.tfar, lanes);
                                                     });
        case Call::occluded16:
            return trace_packets<OccludedPacket16, 16>(
                s, d, p, [&](const int* valid, OccludedPacket16& r, int lanes) {
                    rtcOccluded16(valid, scene.scene, &context, &r.ray);
                    return count_tfar(r.ray.tfar, lanes);
                });
    }
    return 0;
}

}  // namespace

int main() {
    std::printf(
        "# lockstep march against Embree %s packets, one thread, CPU ns per facet, median of 5 interleaved; "
        "disagree: hits that differ, in 1e-6\n",
        RTC_VERSION_STRING);
    std::printf(
        "target,n,theta_deg,map_ns,bits_ns,embree_intersect_ns,embree_occluded_ns,ratio_map,ratio_bits,"
        "disagree_ppm\n");
    for (const int n : {128, 512, 1024}) {
        const HeightField s = bench::field(n, 0.7);
        const MarchGrid grid = make_march_grid(s);
        const bench::TiledScene scene(s);
        for (const double theta_deg : {60.0, 80.0}) {
            const Vec3 d = to_vector({theta_deg, degrees(std::atan2(1, 2))});
            // Embree's best packet call, then every instruction set of the march, interleaved.
            std::vector<double> intersect, occluded;
            long long embree_hits = 0;
            struct Row {
                const char* target;
                std::vector<double> map, bits;
                long long hits = 0;
            };
            std::vector<Row> rows{{"AVX3", {}, {}}, {"AVX2", {}, {}}, {"SSE4", {}, {}}};
            for (int repeat = 0; repeat < 5; ++repeat) {
                auto timed = [](auto&& work) {
                    const double start = bench::cpu_seconds();
                    work();
                    return bench::cpu_seconds() - start;
                };
                auto best_of = [&](Call a, Call b, std::vector<double>& times) {
                    double best = 1e30;
                    for (const Call call : {a, b}) {
                        long long hits = 0;
                        best = std::min(best, timed([&] {
                                            for (int kind = 0; kind < 2; ++kind)
                                                hits +=
                                                    embree(scene, s, d, facet_point(kind, 0.3, 0.7), call);
                                        }));
                        embree_hits = hits;
                    }
                    times.push_back(best);
                };
                best_of(Call::occluded8, Call::occluded16, occluded);
                best_of(Call::intersect8, Call::intersect16, intersect);
                for (Row& row : rows) {
                    if (!force_simd_target(row.target)) continue;
                    // As long as one pass of Embree's packets takes, from the second pass on in the state
                    // that a run of many directions is in.
                    constexpr int passes = 32;
                    row.hits = 0;
                    HitLines lines;
                    row.map.push_back(timed([&] {
                                          for (int pass = 0; pass < 2 * passes; ++pass) {
                                              const int kind = pass % 2;
                                              const RayBundle bundle = make_ray_bundle(
                                                  grid, d, facet_point(kind, 0.3, 0.7), 16384);
                                              march_hits(grid, bundle, 0, 0, n, n, lines);
                                              if (pass < 2)
                                                  for (const uint32_t w : lines.hit)
                                                      row.hits += std::popcount(w);
                                          }
                                      }) /
                                      passes);
                    row.bits.push_back(
                        timed([&] {
                            std::vector<uint32_t> visible(static_cast<size_t>(words_for(n)) * n);
                            for (int pass = 0; pass < 2 * passes; ++pass)
                                march_visible(
                                    grid, make_ray_bundle(grid, d, facet_point(pass % 2, 0.3, 0.7), 16384),
                                    {0, 0, n, n}, visible.data());
                        }) /
                        passes);
                }
            }
            force_simd_target("");
            auto median_ns = [&](std::vector<double> t) {
                std::sort(t.begin(), t.end());
                return t[t.size() / 2] / (2.0 * n * n) * 1e9;
            };
            for (const Row& row : rows) {
                if (row.map.empty()) continue;
                const double map = median_ns(row.map), bits = median_ns(row.bits), hit = median_ns(intersect),
                             shadow = median_ns(occluded);
                std::printf("%s,%d,%.0f,%.2f,%.2f,%.1f,%.1f,%.1f,%.1f,%.1f\n", row.target, n, theta_deg, map,
                            bits, hit, shadow, hit / map, shadow / bits,
                            std::abs(static_cast<double>(row.hits - embree_hits)) / (2.0 * n * n) * 1e6);
                std::fflush(stdout);
            }
        }
    }
}
