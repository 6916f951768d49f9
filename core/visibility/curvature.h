// Horizons on a curved base: from what a flat one has, by its slope and distance (Onoue, Max, Nishita 2004).
// kappa: normal curvature of the base along the azimuth (BaseCurvature::along), above 0 where it is convex.
// Lengths in one unit of the caller's choice, heights above the base. Slopes are tangents of the elevation
// above the horizontal of the point that looks.
#pragma once
#include <string>
#include <vector>

#include "directions/direction.h"
#include "surface/height_field.h"

namespace gonio {

enum class HorizonCorrection {
    exact,   // of a base of constant curvature
    printed  // their eq. 2, first order in kappa
};

// Slope of an occluder that a flat base shows at `slope` and horizontal distance `distance` > 0, seen from
// height `height`. Eq. 2 is right to first order only with the occluder's height (height + distance slope),
// as in its derivation; with the observer's own its error is 7 to 40 times larger. Within a quarter turn:
// |kappa| distance < pi / 2.
double bent_horizon_slope(double slope, double distance, double height, double kappa,
                          HorizonCorrection correction = HorizonCorrection::exact);

// Eq. 3: where the base itself ends the view from `height` above it; minus infinity on a base that is not
// convex. Heights below the base count as 0: they see no further than their rim.
double terminator_slope(double height, double kappa);

// Eq. 2 and 3 together: the higher of the two. distance 0: nothing stands above the horizontal, only the base
// ends the view.
double corrected_horizon_slope(double slope, double distance, double height, double kappa,
                               HorizonCorrection correction = HorizonCorrection::exact);

// A direction that is fixed in the world, told in the frame of a point at base offset (x, y) from the point
// in whose frame it is `direction`: the normal there has turned by K (x, y) (Heidrich et al. 2000, sec. 5).
// Exact for cylinders and, on a sphere, along the great circle to the point.
Vec3 turned_direction(const Vec3& direction, const BaseCurvature& base, double x, double y);

// `direction` after the frame has turned by `turn` radians towards (axis_x, axis_y), a horizontal unit
// vector.
Vec3 turned_direction(const Vec3& direction, double turn, double axis_x, double axis_y);

// A straight ray towards `view`, z > 0, told in the frame of the base point over which it passes at height
// `from`: what it is in the frame of the point over which it passes at height `at`, where it is met from
// above. Exact for spheres and along principal directions; near the horizon of a convex base, where it does
// not come down to that height, told where it is nearest.
Vec3 view_at_height(const Vec3& view, const BaseCurvature& base, double from, double at);

// Throws Error("/base/kappa_1" or "_2") where the relief does not fit on its base: parallel surfaces at its
// heights would nearly fold or more than double (|kappa h| above 1/2), or a cell spans more than a quarter of
// a radian.
void check_base(const HeightField& surface);

// Sentences for the report on how far the curvature may be trusted; none for a gentle or flat base.
std::vector<std::string> base_warnings(const HeightField& surface);

// Where a point at base offset (x, y) and height h stands in the frame of the base point at the origin.
Vec3 displaced_position(const BaseCurvature& base, double x, double y, double height);

// The flat triangle between the displaced nodes of a facet (surface/facet_mesh.h), in the frame of the base
// at its centroid.
struct DisplacedFacet {
    Vec3 normal;
    double area;  // over that of the base, pitch_x pitch_y
};
DisplacedFacet displaced_facet(const HeightField& surface, int kind, int i, int j);

}  // namespace gonio
