#include "scattering/embree_scene.h"

#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"

namespace gonio {
namespace {

// Packets of 8 beat single rays, packets of 16 and streams on every scene measured (shared/performance A,
// tests/bench).
constexpr int width = 8;
constexpr int max_reentries = 1 << 16;  // a ray that is still below the top then runs along a groove for ever

// Embree wants denormals flushed; nobody else in the process asked for that.
class FlushDenormals {
  public:
    FlushDenormals() : saved_(_mm_getcsr()) {
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    }
    ~FlushDenormals() { _mm_setcsr(saved_); }
    FlushDenormals(const FlushDenormals&) = delete;
    FlushDenormals& operator=(const FlushDenormals&) = delete;

  private:
    unsigned saved_;
};

struct Margins {
    int x = 0, y = 0;
};

// Copies of the surface around the period, wide enough that most rays clear the top inside them: what leaves
// re-enters, so this is a matter of speed only (8 to 128 cells made no difference at 128 x 128). Wider ones
// would cost precision: the error of a hit grows with the length of the ray inside the scene.
Margins margins(const HeightField& s) {
    const auto [low, high] = std::minmax_element(s.heights.begin(), s.heights.end());
    const double cells = static_cast<double>(s.nx) * s.ny;
    const double budget = std::max(2.5e5, 1.05 * cells);
    for (double reach = *high - *low;; reach *= 0.8) {
        const double x = std::clamp(std::ceil(reach / s.pitch_x), 8.0, 32.0);
        const double y = std::clamp(std::ceil(reach / s.pitch_y), 8.0, 32.0);
        const bool smallest = x == 8 && y == 8;
        if (smallest || (s.nx + 2 * x) * (s.ny + 2 * y) <= budget)
            return {static_cast<int>(x), static_cast<int>(y)};
    }
}

long long built_cells(const HeightField& s, const Margins& m) {
    return (s.nx + 2LL * m.x) * (s.ny + 2LL * m.y);
}

double rms_step(const HeightField& s) {
    double sum = 0;
    for (int j = 0; j < s.ny; ++j)
        for (int i = 0; i < s.nx; ++i) {
            const double h = s.at(i, j), x = s.at(i + 1, j) - h, y = s.at(i, j + 1) - h;
            sum += x * x + y * y;
        }
    const double rms = std::sqrt(sum / (2.0 * s.nx * s.ny));
    return rms > 0 ? rms : 1;
}

// What all rays have in common.
template <class Packet>
void prepare(Packet& rays) {
    for (int lane = 0; lane < width; ++lane) {
        rays.tnear[lane] = 0;
        rays.time[lane] = 0;
        rays.mask[lane] = ~0u;
        rays.id[lane] = 0;
        rays.flags[lane] = 0;
    }
}

void load(const ScenePoint& origin, const ScenePoint& direction, float far, RTCRay8& rays, int lane) {
    rays.org_x[lane] = origin.x;
    rays.org_y[lane] = origin.y;
    rays.org_z[lane] = origin.z;
    rays.dir_x[lane] = direction.x;
    rays.dir_y[lane] = direction.y;
    rays.dir_z[lane] = direction.z;
    rays.tfar[lane] = far;
}

// The context of Embree for packets that need not be coherent: on sparse origins its coherent traversal takes
// 3 times as long, and on dense ones it gains nothing.
RTCIntersectContext incoherent_context() {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    return context;
}

constexpr float infinity = std::numeric_limits<float>::infinity();

}  // namespace

long long EmbreeScene::estimated_bytes(const HeightField& s) {
    return 280 * built_cells(s, margins(s));  // measured: 240 bytes a cell at 1024 x 1024
}

EmbreeScene::EmbreeScene(const HeightField& s)
    : nx_(s.nx), ny_(s.ny), pitch_x_(s.pitch_x), pitch_y_(s.pitch_y), unit_z_(rms_step(s)) {
    const Margins m = margins(s);
    margin_x_ = m.x;
    margin_y_ = m.y;
    stride_ = nx_ + 2 * m.x + 1;
    const int rows = ny_ + 2 * m.y + 1;
    const size_t n_vertices = static_cast<size_t>(stride_) * rows;
    vertices_.resize(3 * n_vertices + 1);
    top_ = -infinity;
    bottom_ = infinity;
    float* vertex = vertices_.data();
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < stride_; ++i, vertex += 3) {
            vertex[0] = static_cast<float>(i - m.x);
            vertex[1] = static_cast<float>(j - m.y);
            vertex[2] = static_cast<float>(s.at(i - m.x, j - m.y) / unit_z_);
            top_ = std::max(top_, vertex[2]);
            bottom_ = std::min(bottom_, vertex[2]);
        }
    top_ += 1e-3f + 1e-5f * std::abs(top_);
    bottom_ -= 1e-3f + 1e-5f * std::abs(bottom_);

    device_ = rtcNewDevice("threads=1,verbose=0");
    if (!device_) throw Error(ErrorCode::internal, "Embree", "no device", "must start");
    const RTCGeometry mesh = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices_.data(), 0,
                               3 * sizeof(float), n_vertices);
    const int cells_x = stride_ - 1, cells_y = rows - 1;
    const size_t n_triangles = size_t{2} * cells_x * cells_y;
    auto* corner = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), n_triangles));
    if (corner)
        for (int j = 0; j < cells_y; ++j)
            for (int i = 0; i < cells_x; ++i) {
                const auto a = static_cast<uint32_t>(static_cast<size_t>(j) * stride_ + i);
                const uint32_t b = a + 1, d = a + static_cast<uint32_t>(stride_), e = d + 1;
                for (const uint32_t index : {a, b, e, a, e, d}) *corner++ = index;
            }
    rtcCommitGeometry(mesh);
    scene_ = rtcNewScene(device_);
    // High quality traces 10 to 20 % faster and builds 5 times slower.
    rtcSetSceneBuildQuality(scene_,
                            built_cells(s, m) < 200'000 ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM);
    rtcAttachGeometry(scene_, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene_);
    if (rtcGetDeviceError(device_) != RTC_ERROR_NONE) {
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
        throw Error(ErrorCode::limit, "Embree", std::to_string(n_triangles) + " triangles",
                    "must fit the memory");
    }
}

EmbreeScene::~EmbreeScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
}

ScenePoint EmbreeScene::direction(const Vec3& world) const {
    const double x = world.x / pitch_x_, y = world.y / pitch_y_, z = world.z / unit_z_;
    const double scale = 1 / std::max({std::abs(x), std::abs(y), std::abs(z)});
    return {static_cast<float>(x * scale), static_cast<float>(y * scale), static_cast<float>(z * scale)};
}

ScenePoint EmbreeScene::surface_point(const SceneHit& hit) const {
    // The height is evaluated where x and y ended up after rounding, so that only its own rounding is left to
    // lift away.
    const float x = static_cast<float>(hit.i) + hit.u, y = static_cast<float>(hit.j) + hit.v;
    const double u = x - static_cast<float>(hit.i), v = y - static_cast<float>(hit.j);
    const double h00 = node(hit.i, hit.j), h11 = node(hit.i + 1, hit.j + 1);
    const double corner = hit.kind == 0 ? node(hit.i + 1, hit.j) : node(hit.i, hit.j + 1);
    const double step_x = hit.kind == 0 ? corner - h00 : h11 - corner;
    const double step_y = hit.kind == 0 ? h11 - corner : corner - h00;
    const double z = h00 + step_x * u + step_y * v;
    const double lift = 0x1p-22 * (std::abs(h00) + std::abs(step_x) + std::abs(step_y));
    return {x, y, static_cast<float>(z + lift)};
}

float EmbreeScene::distance_to_side(const SceneRay& ray) const {
    const auto along = [](float o, float d, int n, int margin) {
        if (d == 0) return infinity;
        return (static_cast<float>(d > 0 ? n + margin : -margin) - o) / d;
    };
    return std::min(along(ray.origin.x, ray.direction.x, nx_, margin_x_),
                    along(ray.origin.y, ray.direction.y, ny_, margin_y_));
}

SceneRay EmbreeScene::reenter(const SceneRay& ray, float distance) const {
    // From a little before the side, so that no seam opens there.
    const double t = distance * (1 - 1e-5);
    const auto wrap = [](double x, int n) {
        const auto wrapped = static_cast<float>(x - n * std::floor(x / n));
        return wrapped < static_cast<float>(n) ? wrapped : 0.0f;
    };
    return {{wrap(ray.origin.x + t * ray.direction.x, nx_), wrap(ray.origin.y + t * ray.direction.y, ny_),
             static_cast<float>(ray.origin.z + t * ray.direction.z)},
            ray.direction};
}

SceneHit EmbreeScene::wrapped_hit(uint32_t primitive, float u, float v) const {
    const auto cell = static_cast<int>(primitive / 2);
    SceneHit hit;
    hit.kind = static_cast<int8_t>(primitive % 2);
    hit.i = wrap_index(cell % (stride_ - 1) - margin_x_, nx_);
    hit.j = wrap_index(cell / (stride_ - 1) - margin_y_, ny_);
    // Barycentric coordinates keep the precision of the cell where origin + t * direction loses it with t.
    hit.u = std::clamp(hit.kind == 0 ? u + v : u, 0.0f, 1.0f);
    hit.v = std::clamp(hit.kind == 0 ? v : u + v, 0.0f, 1.0f);
    return hit;
}

void EmbreeScene::first_hits(std::span<const SceneRay> rays, std::span<SceneHit> hits) const {
    const FlushDenormals flush;
    RTCIntersectContext context = incoherent_context();
    RTCRayHit8 packet;
    prepare(packet.ray);

    std::vector<SceneRay> again;
    std::vector<size_t> again_index;
    const auto trace = [&](std::span<const SceneRay> batch, auto index_of) {
        for (size_t first = 0; first < batch.size(); first += width) {
            const int n = static_cast<int>(std::min<size_t>(width, batch.size() - first));
            alignas(32) int valid[width];
            for (int lane = 0; lane < width; ++lane) {
                valid[lane] = lane < n ? -1 : 0;
                const SceneRay& ray = batch[first + std::min(lane, n - 1)];
                load(ray.origin, ray.direction, infinity, packet.ray, lane);
                packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
                packet.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
            }
            rtcIntersect8(valid, scene_, &context, &packet);
            for (int lane = 0; lane < n; ++lane) {
                const size_t index = index_of(first + lane);
                if (packet.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID) {
                    hits[index] =
                        wrapped_hit(packet.hit.primID[lane], packet.hit.u[lane], packet.hit.v[lane]);
                    continue;
                }
                const SceneRay& ray = batch[first + lane];
                const float side = distance_to_side(ray);
                const float z = side < infinity ? ray.origin.z + side * ray.direction.z
                                                : std::copysign(infinity, ray.direction.z);
                hits[index].kind = z >= top_ ? SceneHit::escaped : SceneHit::lost;
                if (z >= top_ || z <= bottom_) continue;
                again.push_back(reenter(ray, side));
                again_index.push_back(index);
            }
        }
    };
    trace(rays, [](size_t k) { return k; });
    for (int round = 0; !again.empty() && round < max_reentries; ++round) {
        const auto batch = std::exchange(again, {});
        const auto index = std::exchange(again_index, {});
        trace(batch, [&](size_t k) { return index[k]; });
    }
}

void EmbreeScene::visible(std::span<const ScenePoint> origins, std::span<const int> index,
                          const ScenePoint& direction, std::span<uint8_t> visible) const {
    const FlushDenormals flush;
    RTCIntersectContext context = incoherent_context();
    RTCRay8 packet;
    prepare(packet);
    const float run = std::max(std::abs(direction.x), std::abs(direction.y));
    const bool may_leave =
        (top_ - bottom_) * run > direction.z * static_cast<float>(std::min(margin_x_, margin_y_));

    std::vector<ScenePoint> again;
    std::vector<size_t> again_index;
    const auto trace = [&](size_t n_rays, auto origin_of, auto index_of) {
        for (size_t first = 0; first < n_rays; first += width) {
            const int n = static_cast<int>(std::min<size_t>(width, n_rays - first));
            alignas(32) int valid[width];
            float far[width];
            for (int lane = 0; lane < width; ++lane) {
                valid[lane] = lane < n ? -1 : 0;
                const ScenePoint& origin = origin_of(first + std::min(lane, n - 1));
                far[lane] = (top_ - origin.z) / direction.z;
                load(origin, direction, far[lane], packet, lane);
            }
            rtcOccluded8(valid, scene_, &context, &packet);
            for (int lane = 0; lane < n; ++lane) visible[index_of(first + lane)] = !(packet.tfar[lane] < 0);
            for (int lane = 0; may_leave && lane < n; ++lane) {
                const SceneRay ray{origin_of(first + lane), direction};
                const float side = distance_to_side(ray);
                if (packet.tfar[lane] < 0 || side >= far[lane]) continue;
                again.push_back(reenter(ray, side).origin);
                again_index.push_back(index_of(first + lane));
            }
        }
    };
    trace(
        index.size(), [&](size_t k) -> const ScenePoint& { return origins[index[k]]; },
        [](size_t k) { return k; });
    for (int round = 0; !again.empty() && round < max_reentries; ++round) {
        const auto batch = std::exchange(again, {});
        const auto indices = std::exchange(again_index, {});
        trace(
            batch.size(), [&](size_t k) -> const ScenePoint& { return batch[k]; },
            [&](size_t k) { return indices[k]; });
    }
}

}  // namespace gonio
