// Bidirectional texture functions: what a camera sees of every place of the base plane, from every view under
// every light (Heidrich et al. 2000, sec. 6).
//
// A value is the apparent BRDF of a pixel, L / (E0 cos_i) in 1/sr: the radiance L that the pixel's view ray
// meets, over the irradiance E0 cos_i of the flat base plane (under an environment over its irradiance of
// that plane, channel by channel). So its mean over one period is the BRDF of the relief. It has no other
// cosine, and is no BRDF of any one point: shadows, masks and light from elsewhere are in it, and it is not
// reciprocal.
//
// Facet parts have one radiance each, and views only choose among them: so radiances and view maps are the
// whole of it, 20 times smaller than the images and without loss (shared/performance_techniques 4).
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/monitor.h"
#include "measure/plan.h"
#include "measure/prediction.h"
#include "measure/report.h"
#include "scattering/environment.h"
#include "table/table.h"

namespace gonio {

// Cameras of a two-plane light field (Levoy and Hanrahan 1996): n_u x n_v places spread evenly over a
// rectangle above the middle of the measured one, v slowest. All see the same pixels of the base plane.
struct CameraPlane {
    int n_u = 1, n_v = 1;
    double width = 0, depth = 0;  // of the rectangle, metres
    double height = 0;            // above the plane of the pixels, metres
};

struct BtfPlan {
    std::vector<AnglesDeg> incident;  // none: under an environment
    int azimuths = 16;                // of its horizon slices, >= 3
    std::vector<AnglesDeg> outgoing;
    std::optional<CameraPlane> cameras;  // instead of outgoing directions
    int pixels_x = 0, pixels_y = 0;      // over the measured rectangle; 0: one a cell
    // Places inside a pixel whose values are averaged; 1: its centre. With one pixel a cell and one sample, a
    // view from straight above sees but one of the two facets of each cell.
    int pixel_samples = 1;
    // Where a view ray belongs to a pixel: at the highest point of the relief, or at height 0 of the surface
    // as it was given.
    enum class Plane { top, zero } plane = Plane::top;
    int max_order = 0;  // as in BrdfPlan
    Accuracy accuracy;  // target: of the area means
};

// What both forms of a file hold, in this order.
struct BtfShape {
    int n_views = 0, n_lights = 0, n_channels = 0;
    int pixels_x = 0, pixels_y = 0, pixel_samples = 1;
    size_t n_facets = 0;  // facet_index() of visibility/view_map.h runs below it

    size_t n_pixels() const { return static_cast<size_t>(pixels_x) * pixels_y; }
    size_t radiance_size() const { return static_cast<size_t>(n_channels) * n_lights * n_facets; }
    size_t maps_size() const { return static_cast<size_t>(n_views) * pixel_samples * n_pixels(); }
    size_t images_size() const { return static_cast<size_t>(n_views) * n_lights * n_channels * n_pixels(); }
};

struct Btf {
    BtfShape shape;
    // [channel][light][facet]: bits of a half each, in 1/sr as above; an environment is one light.
    std::vector<uint16_t> radiance;
    std::vector<uint32_t> view_maps;  // [view][sample][pixel]: the facet
    // Of the images: their means over the pixels, which estimate the BRDF. se: of the random runs; bias: what
    // the places of the pixels and the orders left out may do, and a guess (mesh_bias.h) of what irradiance
    // does that is constant over a facet part. [channel][light][view], also under an environment, where its
    // `incident` is empty.
    Table mean;
    std::vector<double> pixel_se;  // [channel][light], 1/sr: standard error of one facet's value,
                                   // rms over the area of the relief
};

// Radiance over position and direction: the same numbers, as a kind of measurement of its own. Planes and
// directions: a BTF whose pixels are read for one light; two planes: cameras. Or under an environment.
struct LightFieldPlan : BtfPlan {};

// Where the cameras of a plan stand: x, y of the surface and z above its mean height, metres.
std::vector<Vec3> camera_places(const HeightField& surface, const BtfPlan& plan);

struct BtfResult {
    Btf btf;
    Report report;
};

// environment: the light of a plan without incident directions, and only of such a one. Throws Error: for
// materials that are not Lambertian; for an environment on a curved base, or an RGB one on a spectrum; limit
// if it does not fit options.max_bytes; cancelled.
BtfResult measure_btf(const HeightField& surface, const Material& material, const BtfPlan& plan,
                      const RunOptions& options, const Monitor& monitor = {},
                      const Environment* environment = nullptr);

// bytes: of one output of images, two bytes a pixel; the factored form takes shape.radiance_size() and
// maps_size().
Prediction predict_btf(const HeightField& surface, const Material& material, const BtfPlan& plan);

// The images of one view: out[light][channel][pixel], halves. radiance and view_maps as in Btf. One function
// for all who write or read images, so that they agree to the last bit.
void expand_view(const BtfShape& shape, std::span<const uint16_t> radiance,
                 std::span<const uint32_t> view_maps, int view, std::span<uint16_t> out);

}  // namespace gonio
