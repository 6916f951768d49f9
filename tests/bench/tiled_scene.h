// The rival of the benchmarks of visibility.
#pragma once
#include <embree3/rtcore.h>

#include "surface/height_field.h"

namespace gonio::bench {

// 3 x 3 periods of triangles, in cells: what a careful user of Embree would build for these rays.
struct TiledScene {
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    explicit TiledScene(const HeightField& s) {
        const int n = 3 * s.nx + 1, m = 3 * s.ny + 1;
        rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
        RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        auto* v = static_cast<float*>(rtcSetNewGeometryBuffer(
            mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, static_cast<size_t>(n) * m));
        for (int j = 0; j < m; ++j)
            for (int i = 0; i < n; ++i) {
                *v++ = static_cast<float>(i - s.nx);
                *v++ = static_cast<float>(j - s.ny);
                *v++ = static_cast<float>(s.at(i, j) / s.pitch_x);
            }
        auto* t =
            static_cast<unsigned*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                           12, static_cast<size_t>(2) * (n - 1) * (m - 1)));
        for (int j = 0; j + 1 < m; ++j)
            for (int i = 0; i + 1 < n; ++i) {
                const unsigned a = j * n + i, b = a + 1, c = a + n, d = c + 1;
                for (const unsigned k : {a, b, d, a, d, c}) *t++ = k;
            }
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene, mesh);
        rtcReleaseGeometry(mesh);
        rtcCommitScene(scene);
    }
    ~TiledScene() {
        rtcReleaseScene(scene);
        rtcReleaseDevice(device);
    }
};

}  // namespace gonio::bench
