#include "measure/btf_views.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "base/half.h"
#include "base/parallel.h"
#include "base/text.h"
#include "measure/run.h"
#include "visibility/view_map.h"

namespace gonio {
namespace {

PixelGrid pixel_grid(const HeightField& s, const BtfPlan& plan) {
    PixelGrid pixels;
    pixels.area = {s.border_x, s.border_y, s.nx - 2 * s.border_x, s.ny - 2 * s.border_y};
    pixels.nx = plan.pixels_x > 0 ? plan.pixels_x : pixels.area.width;
    pixels.ny = plan.pixels_y > 0 ? plan.pixels_y : pixels.area.height;
    pixels.plane_height = view_plane_height(s, plan);
    return pixels;
}

// Pairs that mirror each other in the pixel's centre, by the R2 sequence (Roberts 2018), and where that
// begins if they are odd: with whole cells a pixel both kinds of facets are seen equally often from above.
std::vector<SubSample> pixel_places(int n, const SubSample& first) {
    std::vector<SubSample> places;
    const std::vector<SubSample> sequence = shifted_sub_samples(1 + n / 2, first.a, first.b);
    for (int k = 1; k <= n / 2; ++k) {
        places.push_back(sequence[k]);
        places.push_back({1 - sequence[k].a, 1 - sequence[k].b});
    }
    if (n % 2 != 0) places.push_back(sequence[0]);
    return places;
}

}  // namespace

double view_plane_height(const HeightField& s, const BtfPlan& plan) {
    return plan.plane == BtfPlan::Plane::zero ? -s.mean_height
                                              : *std::max_element(s.heights.begin(), s.heights.end());
}

Vec3 pixel_to_camera(const HeightField& s, double plane_height, const Vec3& camera, const BtfShape& shape,
                     size_t pixel) {
    const int i = static_cast<int>(pixel % shape.pixels_x), j = static_cast<int>(pixel / shape.pixels_x);
    const double x = s.border_x + (i + 0.5) * (s.nx - 2.0 * s.border_x) / shape.pixels_x,
                 y = s.border_y + (j + 0.5) * (s.ny - 2.0 * s.border_y) / shape.pixels_y;
    const Vec3 d{camera.x - x * s.pitch_x, camera.y - y * s.pitch_y, camera.z - plane_height};
    const double length = std::sqrt(dot(d, d));
    return {d.x / length, d.y / length, d.z / length};
}

BtfShape btf_shape(const HeightField& s, const Material& material, const BtfPlan& plan, int refinement) {
    return {plan.cameras ? plan.cameras->n_u * plan.cameras->n_v : static_cast<int>(plan.outgoing.size()),
            std::max(1, static_cast<int>(plan.incident.size())),  // an environment is one light
            static_cast<int>(material.channels.size()),
            plan.pixels_x > 0 ? plan.pixels_x : s.nx - 2 * s.border_x,
            plan.pixels_y > 0 ? plan.pixels_y : s.ny - 2 * s.border_y,
            plan.pixel_samples,
            2 * static_cast<size_t>(s.nx) * s.ny * refinement * refinement};
}

std::vector<AnglesDeg> view_angles(const HeightField& s, const BtfPlan& plan) {
    if (!plan.cameras) return plan.outgoing;
    std::vector<AnglesDeg> angles;
    for (const Vec3& place : camera_places(s, plan)) {
        const double x = place.x - 0.5 * s.width(), y = place.y - 0.5 * s.depth();
        angles.push_back(
            {degrees(std::atan2(std::hypot(x, y), plan.cameras->height)), degrees(std::atan2(y, x))});
    }
    return angles;
}

std::vector<Vec3> camera_places(const HeightField& s, const BtfPlan& plan) {
    const CameraPlane& cameras = *plan.cameras;
    const double height = view_plane_height(s, plan) + cameras.height;
    std::vector<Vec3> places;
    for (int v = 0; v < cameras.n_v; ++v)
        for (int u = 0; u < cameras.n_u; ++u)
            places.push_back({0.5 * s.width() + ((u + 0.5) / cameras.n_u - 0.5) * cameras.width,
                              0.5 * s.depth() + ((v + 0.5) / cameras.n_v - 0.5) * cameras.depth, height});
    return places;
}

std::optional<MarchGrid> bent_view_grid(const HeightField& surface, const BtfPlan& plan) {
    if (surface.base.is_curved() && plan.cameras)
        throw Error(ErrorCode::invalid_input, "/base", "",
                    "cameras at a finite distance see flat bases only; ask for \"outgoing\" directions");
    if (!surface.base.corrects_horizons()) return std::nullopt;
    HeightField bent = surface;
    bent.base.correction = BaseCorrection::none;
    return make_march_grid(bent);
}

double frame_doubt(const HeightField& s, const BtfPlan& plan, std::span<const uint32_t> map, int view) {
    if (!s.base.is_curved()) return 0;
    const size_t n_cells = static_cast<size_t>(s.nx) * s.ny;
    double height = 0;
    for (const uint32_t facet : map) {
        const int kind = static_cast<int>(facet / n_cells % 2), j = static_cast<int>(facet % n_cells / s.nx),
                  i = static_cast<int>(facet % s.nx);
        height += (s.at(i, j) + s.at(i + 1, j + 1) + (kind == 0 ? s.at(i + 1, j) : s.at(i, j + 1))) / 3;
    }
    height = height / static_cast<double>(map.size()) - view_plane_height(s, plan);
    const double slope = std::tan(radians(plan.outgoing[view].theta_deg));
    return std::max(std::abs(s.base.kappa_1), std::abs(s.base.kappa_2)) * std::abs(height) * slope * slope;
}

std::vector<uint32_t> make_view_maps(const HeightField& surface, const MarchGrid& grid, const BtfPlan& plan,
                                     const BtfShape& shape, const std::vector<int>& views,
                                     const SubSample& place, int refinement, int n_threads,
                                     const Monitor& monitor, double& unresolved) {
    const PixelGrid pixels = pixel_grid(surface, plan);
    std::vector<Vec3> cameras, directions;
    std::optional<TraceGrid> trace_grid;
    if (plan.cameras) {
        trace_grid = make_trace_grid(surface);
        cameras = camera_places(surface, plan);
        if (!(cameras[0].z > grid.highest * grid.pitch_x))
            throw Error(ErrorCode::invalid_input, "/measure/cameras/height",
                        number_text(plan.cameras->height) + " m",
                        "must put the cameras above the highest point of the relief");
    } else {
        for (const AnglesDeg& view : plan.outgoing) directions.push_back(to_vector(view));
    }
    std::vector<uint32_t> maps(views.size() * shape.pixel_samples * shape.n_pixels());
    const std::vector<SubSample> places = pixel_places(shape.pixel_samples, place);
    std::vector<long long> given_up(views.size() * shape.pixel_samples);
    parallel_for(static_cast<int>(given_up.size()), n_threads, [&](int task) {
        monitor.check_cancelled();
        const auto [a, b] = places[task % shape.pixel_samples];
        const int view = views[task / shape.pixel_samples];
        const ViewMap map =
            plan.cameras ? make_camera_map(*trace_grid, surface, cameras[view], pixels, a, b, refinement)
                         : make_view_map(grid, directions[view], pixels, a, b, refinement);
        std::copy(map.facet.begin(), map.facet.end(),
                  maps.begin() + static_cast<long>(task * shape.n_pixels()));
        given_up[task] = map.unresolved;
    });
    for (const long long n : given_up) unresolved += static_cast<double>(n);
    return maps;
}

void expand_view(const BtfShape& shape, std::span<const uint16_t> radiance,
                 std::span<const uint32_t> view_maps, int view, std::span<uint16_t> out) {
    constexpr size_t chunk = 4096;  // pixels: their part of the map stays in the cache over all images
    const size_t n = shape.n_pixels();
    const uint32_t* map = view_maps.data() + static_cast<size_t>(view) * shape.pixel_samples * n;
    const float share = 1.0f / static_cast<float>(shape.pixel_samples);
    for (size_t first = 0; first < n; first += chunk) {
        const size_t end = std::min(n, first + chunk);
        for (int l = 0; l < shape.n_lights; ++l)
            for (int c = 0; c < shape.n_channels; ++c) {
                const uint16_t* plane =
                    radiance.data() + (static_cast<size_t>(c) * shape.n_lights + l) * shape.n_facets;
                uint16_t* image = out.data() + (static_cast<size_t>(l) * shape.n_channels + c) * n;
                if (shape.pixel_samples == 1) {
                    for (size_t p = first; p < end; ++p) image[p] = plane[map[p]];
                    continue;
                }
                for (size_t p = first; p < end; ++p) {
                    float sum = 0;
                    for (int s = 0; s < shape.pixel_samples; ++s)
                        sum += from_half_bits(plane[map[s * n + p]]);
                    image[p] = half_bits(share * sum);
                }
            }
    }
}

}  // namespace gonio
