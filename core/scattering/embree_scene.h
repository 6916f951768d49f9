// The one home of Embree: the facets of a relief as a periodic scene, without finite tiling. Used by the path
// tracer only; the fast engine marches instead (shared/performance B: a tree never pays for a bundle of
// parallel rays).
//
// Embree works in float, so the scene lives in its own units: x and y in cells, z in rms steps between
// neighbouring nodes. Hits are invariant under that affine map, and pitches of 1000:1 or slopes of 1e-6 or
// 1e3 are all of order one in it. Directions must be mapped with `direction`.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "directions/direction.h"
#include "surface/height_field.h"

struct RTCDeviceTy;
struct RTCSceneTy;

namespace gonio {

struct ScenePoint {
    float x = 0, y = 0, z = 0;
};
struct SceneRay {
    ScenePoint origin, direction;
};
struct SceneHit {
    enum Kind : int8_t {
        escaped = -1,
        lost = -2
    };                      // `lost` fell through a seam between facets: rounding, counted by the caller
    int i = 0, j = 0;       // cell, in [0, nx) x [0, ny)
    int8_t kind = escaped;  // facet 0 or 1 as in facet_mesh.h, or a Kind
    float u = 0, v = 0;     // position inside the cell, in [0, 1]
};

class EmbreeScene {
  public:
    explicit EmbreeScene(const HeightField& surface);
    ~EmbreeScene();
    EmbreeScene(const EmbreeScene&) = delete;
    EmbreeScene& operator=(const EmbreeScene&) = delete;

    // A world direction in scene units, scaled to largest component 1.
    ScenePoint direction(const Vec3& world) const;
    // The height of a horizontal plane just above everything, where rays of the camera start.
    float top() const { return top_; }
    // The point of a hit on its facet, lifted by a few units in the last place so that no ray from it meets
    // its own plane.
    ScenePoint surface_point(const SceneHit& hit) const;

    // First facet of each ray. Origins lie in the period [0, nx) x [0, ny). coherent: neighbouring rays are
    // nearly parallel.
    void first_hits(std::span<const SceneRay> rays, std::span<SceneHit> hits) const;
    // visible[k] = 1 if nothing lies from origins[index[k]] along `direction` (which points up) to infinity,
    // else 0.
    void visible(std::span<const ScenePoint> origins, std::span<const int> index, const ScenePoint& direction,
                 std::span<uint8_t> visible) const;

    // Working memory of a scene for a surface of this size, estimated from above, in bytes.
    static long long estimated_bytes(const HeightField& surface);

  private:
    // Distance at which a ray from the period reaches the side of what is built.
    float distance_to_side(const SceneRay& ray) const;
    // The ray, moved to the same place one or more periods back.
    SceneRay reenter(const SceneRay& ray, float distance) const;
    SceneHit wrapped_hit(uint32_t primitive, float u, float v) const;
    float node(int i, int j) const {
        return vertices_[((static_cast<size_t>(j) + margin_y_) * stride_ + i + margin_x_) * 3 + 2];
    }

    int nx_, ny_, margin_x_, margin_y_;  // a skirt of copied cells spares most rays the re-entry
    int stride_;                         // nodes in a row of the built grid
    double pitch_x_, pitch_y_, unit_z_;
    float top_, bottom_;
    std::vector<float> vertices_;  // x, y, z of each node, and one float that Embree may read beyond the end
    RTCDeviceTy* device_ = nullptr;
    RTCSceneTy* scene_ = nullptr;
};

}  // namespace gonio
