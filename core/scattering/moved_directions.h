// Scattering on a curved base by what a flat one shows (Heidrich et al. 2000, sec. 5): two points that see
// each other still do, but the direction between them has moved, by their distance, their heights and the
// curvature.
#pragma once
#include <span>
#include <vector>

#include "scattering/link_operator.h"
#include "visibility/direction_mesh.h"

namespace gonio {

struct MovedDirection {
    Vec3 leaving, arriving;  // to what is seen, in the frame of the start and in that of what is seen
    double growth;           // of the triangle fan around it, for its solid angle
};

// Directions that meet nothing stay, but for those beside others that do: the horizon moves as a whole. Where
// fans fold over, which is where visibility should have changed, they count as nothing.
class MovedDirections {
  public:
    // The directions that one part of the facets traces, closed to a sphere by directions that are too steep
    // to meet anything.
    struct Fans {
        DirectionMesh mesh;
        std::vector<Vec3> still;          // where they are on the flat base
        std::vector<double> solid_angle;  // of their fans there
        std::vector<int> place;           // of a direction of the set; -1 of another part
    };
    struct Scratch {
        std::vector<Vec3> moved;
        std::vector<char> meets;
        std::vector<double> solid_angle;
    };

    // Every facet part traces the directions i of the set with i mod n_parts its part. The references must
    // outlive it.
    MovedDirections(const MarchGrid& grid, const Tile& tile, const DirectionSet& set, int n_threads);

    // met: all rays of one unknown that met something over the flat relief; out is parallel to it.
    void move(size_t unknown, std::span<const LinkOrigin> met, Scratch& scratch,
              std::vector<MovedDirection>& out) const;

  private:
    const MarchGrid& grid_;
    const Tile& tile_;
    const DirectionSet& set_;
    std::vector<Fans> fans_;  // of each part
};

// Weighs the links of an operator that was traced over the flat relief (chunk.origins): cosines of the moved
// directions, and as solid angle that of the direction times its growth.
void weigh_moved_directions(const MarchGrid& grid, const Tile& tile, const DirectionSet& set, int n_threads,
                            LinkOperator& op);

}  // namespace gonio
