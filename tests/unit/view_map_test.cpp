// View maps against a ray that is tried on every triangle it could meet, and against V-grooves on paper.
#include "visibility/view_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "surface/generate.h"
#include "visibility/crossings.h"

namespace gonio {
namespace {

struct Seen {
    uint32_t facet = ~0u;
    double clearance =
        1e300;  // from the edges of the facet and from what it passes before, in barycentric units
};

// In double, without any march: the nearest of all triangles around.
Seen look(const HeightField& s, const Vec3& view, double x, double y, double z, int refinement) {
    Seen best;
    double nearest = 1e300;
    const Vec3 d{-view.x, -view.y, -view.z};
    // Down to a height below everything.
    const double far_x = x + 6 / view.z * d.x, far_y = y + 6 / view.z * d.y;
    const auto cell = [](double position, double pitch) {
        return static_cast<int>(std::floor(position / pitch));
    };
    for (int j = cell(std::min(y, far_y), s.pitch_y) - 1; j <= cell(std::max(y, far_y), s.pitch_y) + 1; ++j)
        for (int i = cell(std::min(x, far_x), s.pitch_x) - 1; i <= cell(std::max(x, far_x), s.pitch_x) + 1;
             ++i)
            for (int kind = 0; kind < 2; ++kind) {
                const double h00 = s.at(i, j), h11 = s.at(i + 1, j + 1),
                             own = kind == 0 ? s.at(i + 1, j) : s.at(i, j + 1);
                const double gu = kind == 0 ? own - h00 : h11 - own, gv = kind == 0 ? h11 - own : own - h00;
                const double u0 = x / s.pitch_x - i, v0 = y / s.pitch_y - j, du = d.x / s.pitch_x,
                             dv = d.y / s.pitch_y;
                const double closing = d.z - gu * du - gv * dv;
                if (std::abs(closing) < 1e-12) continue;
                const double t = (h00 + gu * u0 + gv * v0 - z) / closing;
                const double u = u0 + t * du, v = v0 + t * dv;
                const double a = kind == 0 ? 1 - u : 1 - v, b = std::abs(u - v), c = kind == 0 ? v : u;
                const bool own_side = kind == 0 ? u >= v : v >= u;
                const double inside = std::min({a, own_side ? b : -b, c});
                if (t < -1e-9) continue;
                best.clearance = std::min(best.clearance, std::abs(inside) > 1e-4 ? 1e300 : 0.0);
                if (inside < 0 || t >= nearest) continue;
                nearest = t;
                const int part = facet_part(kind, u, v, refinement);
                best.facet = static_cast<uint32_t>(
                    facet_index(s.nx, s.ny, part, kind, wrap_index(j, s.ny), wrap_index(i, s.nx)));
            }
    return best;
}

// Noise; a larger one is a plain with a few spires, where rays pass many cells at once.
HeightField bumpy(int nx, int ny, double pitch_y) {
    std::vector<double> heights;
    for (int k = 0; k < nx * ny; ++k)
        heights.push_back(nx > 20 ? (k % 83 == 0 ? 1.9 : -1.0)
                                  : 1.5 * std::sin(12.9898 * k + 0.3) * std::cos(4.1 * k));
    return make_height_field(nx, ny, 1.0, pitch_y, heights);
}

struct Case {
    int nx, ny;
    double pitch_y;
    int pixels_x, pixels_y, refinement;
    double plane_height;
};

class ViewMapOf : public testing::TestWithParam<Case> {};

TEST_P(ViewMapOf, IsWhatARayTriedOnEveryTriangleMeets) {
    const Case& c = GetParam();
    const HeightField surface = bumpy(c.nx, c.ny, c.pitch_y);
    const MarchGrid grid = make_march_grid(surface);
    const PixelGrid pixels{{0, 0, c.nx, c.ny}, c.pixels_x, c.pixels_y, c.plane_height};
    int compared = 0;
    for (const AnglesDeg& angles : {AnglesDeg{0, 0}, AnglesDeg{35, 20}, AnglesDeg{55, 107},
                                    AnglesDeg{60, 200}, AnglesDeg{50, 290}, AnglesDeg{45, 90}}) {
        const Vec3 view = to_vector(angles);
        const ViewMap map = make_view_map(grid, view, pixels, 0.37, 0.61, c.refinement);
        EXPECT_EQ(map.unresolved, 0);
        for (int j = 0; j < c.pixels_y; ++j)
            for (int i = 0; i < c.pixels_x; ++i) {
                // Along the view ray from the pixel's plane to a height above everything.
                const double top = 3.2, climb = (top - c.plane_height) / view.z;
                const double x = (i + 0.37) * c.nx / c.pixels_x + climb * view.x,
                             y = (j + 0.61) * c.ny * c.pitch_y / c.pixels_y + climb * view.y;
                const Seen seen = look(surface, view, x, y, top, c.refinement);
                if (seen.clearance < 1e-4) continue;
                ++compared;
                EXPECT_EQ(map.facet[static_cast<size_t>(j) * c.pixels_x + i], seen.facet)
                    << angles.theta_deg << ", " << angles.phi_deg << " pixel " << i << ", " << j;
            }
    }
    EXPECT_GT(compared, 4 * c.pixels_x * c.pixels_y);
}

TEST_P(ViewMapOf, IsSoForTheRaysOfACamera) {
    const Case& c = GetParam();
    const HeightField surface = bumpy(c.nx, c.ny, c.pitch_y);
    const TraceGrid grid = make_trace_grid(surface);
    const PixelGrid pixels{{0, 0, c.nx, c.ny}, c.pixels_x, c.pixels_y, c.plane_height};
    int compared = 0;
    for (const Vec3& place :
         {Vec3{0.4 * c.nx, 0.6 * c.ny, 20.0}, Vec3{-15, 3, 12}, Vec3{c.nx + 9.0, c.ny + 14.0, 20}}) {
        const ViewMap map = make_camera_map(grid, surface, place, pixels, 0.37, 0.61, c.refinement);
        EXPECT_EQ(map.unresolved, 0);
        for (int j = 0; j < c.pixels_y; ++j)
            for (int i = 0; i < c.pixels_x; ++i) {
                const double px = (i + 0.37) * c.nx / c.pixels_x,
                             py = (j + 0.61) * c.ny * c.pitch_y / c.pixels_y;
                const Vec3 view{place.x - px, place.y - py, place.z - c.plane_height};
                const double top = 3.2, climb = (top - c.plane_height) / view.z;
                const Seen seen =
                    look(surface, view, px + climb * view.x, py + climb * view.y, top, c.refinement);
                if (seen.clearance < 1e-4) continue;
                ++compared;
                EXPECT_EQ(map.facet[static_cast<size_t>(j) * c.pixels_x + i], seen.facet)
                    << " pixel " << i << ", " << j;
            }
    }
    EXPECT_GT(compared, 2 * c.pixels_x * c.pixels_y);
}

INSTANTIATE_TEST_SUITE_P(
    Sizes, ViewMapOf,
    testing::Values(Case{12, 10, 1.0, 12, 10, 1, 1.5},  // a pixel a cell
                    Case{12, 10, 0.7, 24, 20, 1, 1.5},  // four, and another pitch
                    Case{12, 10, 1.0, 9, 4, 2,
                         -0.4},  // fewer, of another shape; a lower plane; parts of facets
                    Case{34, 33, 1.3, 17, 11, 1, 0.2},  // more than a block of lanes, both ways of marching
                    Case{34, 36, 1.0, 17, 9, 4, 1.5}, Case{7, 1, 1.0, 14, 2, 1, 1.5}));  // one row

// A V-groove of 45 degrees, depth P/2, seen from 60 degrees across it: only the walls that face the viewer
// are seen, from their ridge at -P/2 down to where the line of sight passes the next ridge, x = -P/2 (1 - tan
// 30) / (1 + tan 30).
TEST(ViewMap, OfAVGrooveShowsTheFacingWallDownToTheLineOverTheNextRidge) {
    const int n = 256;
    const HeightField groove = generate_v_groove(n, 1, 45);
    const MarchGrid grid = make_march_grid(groove);
    for (const double side : {0.0, 180.0}) {
        const PixelGrid pixels{{0, 0, n, 1}, n, 1, static_cast<double>(grid.highest) * groove.pitch_x};
        const ViewMap map = make_view_map(grid, to_vector({60, side}), pixels, 0.5, 0.5, 1);
        const double t = std::tan(radians(30)), last = 0.5 * (1 - t) / (1 + t);
        std::vector<int> seen(n, 0);
        for (const uint32_t facet : map.facet) ++seen[facet % n];
        for (int column = 0; column < n; ++column) {
            // The wall in column c lies between x = c / n and (c + 1) / n; mirrored for the other side.
            const double x = side == 0.0 ? (column + 0.5) / n - 1 : -(column + 0.5) / n;
            const bool expected = x > -0.5 && x < -last - 1.0 / n, hidden = x < -0.5 || x > -last + 1.0 / n;
            if (expected) {
                EXPECT_GE(seen[column], 1) << column;
            }
            if (hidden) {
                EXPECT_EQ(seen[column], 0) << column;
            }
        }
    }
}

// The pixel is where the view ray passes its plane: the same place of that plane is the same pixel from every
// side.
TEST(ViewMap, IsParallaxCorrectOnItsPlane) {
    const int n = 64;
    std::vector<double> heights(n * n, 0.0);
    heights[5 * n + 5] = -3;  // a pit: the mean is not 0, the plane around it is the highest point
    const HeightField flat = make_height_field(n, n, 0.5, 0.5, heights);
    const MarchGrid grid = make_march_grid(flat);
    for (const AnglesDeg& view : {AnglesDeg{0, 0}, AnglesDeg{70, 30}, AnglesDeg{75, 250}}) {
        const PixelGrid pixels{{0, 0, n, n}, n, n, static_cast<double>(grid.highest) * flat.pitch_x};
        const ViewMap map = make_view_map(grid, to_vector(view), pixels, 0.3, 0.6, 1);
        for (int j = 10; j < n; ++j)
            for (int i = 10; i < n; ++i) {
                const size_t cell = map.facet[static_cast<size_t>(j) * n + i] % (static_cast<size_t>(n) * n);
                EXPECT_EQ(cell, static_cast<size_t>(j) * n + i);
            }
        // One cell higher, what is seen at a pixel lies tan(theta) cells behind it.
        PixelGrid raised = pixels;
        raised.plane_height += 0.5;
        const ViewMap above = make_view_map(grid, to_vector(view), raised, 0.5, 0.5, 1);
        const double back = std::tan(radians(view.theta_deg));
        const int i = 40, j = 40;
        const size_t cell = above.facet[static_cast<size_t>(j) * n + i] % (static_cast<size_t>(n) * n);
        EXPECT_EQ(static_cast<int>(cell % n),
                  static_cast<int>(std::floor(i + 0.5 - back * std::cos(radians(view.phi_deg)))));
        EXPECT_EQ(static_cast<int>(cell / n),
                  static_cast<int>(std::floor(j + 0.5 - back * std::sin(radians(view.phi_deg)))));
    }
}

}  // namespace
}  // namespace gonio
