// The rival and judge of forward tracing: photons on Embree, stratified over the period, for facets that are
// perfect mirrors. Shares with what it judges the relief and the cells alone.
#pragma once
#include <cmath>
#include <vector>

#include "base/random.h"
#include "directions/cells.h"
#include "scattering/embree_scene.h"
#include "surface/facet_mesh.h"

namespace gonio {

struct Photons {
    std::vector<std::vector<double>> share;  // [order - 1][cell] of the light's flux
    double left = 0;                         // after the last order, or lost between facets
};

class PhotonTracer {
  public:
    PhotonTracer(const HeightField& surface, std::vector<ReceiverCell> cells)
        : surface_(surface), scene_(surface), cells_(std::move(cells)), locator_(cells_) {
        for (int kind = 0; kind < 2; ++kind)
            for (int j = 0; j < surface.ny; ++j)
                for (int i = 0; i < surface.nx; ++i) {
                    const Gradient g = facet_gradient(surface, kind, i, j);
                    const double ratio = area_ratio(g);
                    normals_.push_back({-g.x / ratio, -g.y / ratio, 1 / ratio});
                }
    }

    // strata^2 photons.
    Photons trace(const Vec3& light, int strata, uint64_t stream, int orders = 8) const {
        Photons result;
        result.share.assign(orders, std::vector<double>(cells_.size(), 0.0));
        const double flux = 1.0 / (static_cast<double>(strata) * strata);
        const Vec3 down{-light.x, -light.y, -light.z};
        std::vector<SceneRay> rays;
        std::vector<Vec3> directions;
        std::vector<SceneHit> hits;
        // Squares of strata: neighbouring photons fall on neighbouring facets.
        constexpr int side = 32;
        for (int block = 0; block < ((strata + side - 1) / side) * ((strata + side - 1) / side); ++block) {
            const int x0 = block % ((strata + side - 1) / side) * side,
                      y0 = block / ((strata + side - 1) / side) * side;
            rays.clear();
            directions.clear();
            const ScenePoint d = scene_.direction(down);
            for (int y = y0; y < std::min(strata, y0 + side); ++y)
                for (int x = x0; x < std::min(strata, x0 + side); ++x) {
                    const auto words = random_words(77, stream, static_cast<uint64_t>(y) * strata + x);
                    rays.push_back(
                        {{static_cast<float>((x + uniform_double(words[0])) / strata * surface_.nx),
                          static_cast<float>((y + uniform_double(words[1])) / strata * surface_.ny),
                          scene_.top()},
                         d});
                    directions.push_back(down);
                }
            for (int order = 0; order <= orders && !rays.empty(); ++order) {
                hits.resize(rays.size());
                scene_.first_hits(rays, hits);
                size_t n = 0;
                for (size_t k = 0; k < rays.size(); ++k) {
                    const Vec3 in = directions[k];
                    if (hits[k].kind < 0) {
                        if (hits[k].kind == SceneHit::escaped && order > 0)
                            result.share[order - 1][locator_(in.x, in.y)] += flux;
                        else
                            result.left += flux;
                        continue;
                    }
                    if (order == orders) {
                        result.left += flux;
                        continue;
                    }
                    const Vec3& normal =
                        normals_[(static_cast<size_t>(hits[k].kind) * surface_.ny + hits[k].j) * surface_.nx +
                                 hits[k].i];
                    const double twice = 2 * dot(normal, in);
                    directions[n] = {in.x - twice * normal.x, in.y - twice * normal.y,
                                     in.z - twice * normal.z};
                    rays[n] = {scene_.surface_point(hits[k]), scene_.direction(directions[n])};
                    ++n;
                }
                rays.resize(n);
                directions.resize(n);
            }
        }
        return result;
    }

  private:
    const HeightField& surface_;
    EmbreeScene scene_;
    std::vector<ReceiverCell> cells_;
    CellLocator locator_;
    std::vector<Vec3> normals_;
};

}  // namespace gonio
