#include "measure/prediction.h"

#include <algorithm>

#include "material/lobe_shape.h"
#include "measure/brdf_scene.h"
#include "measure/transport_choice.h"
#include "visibility/march_bounds.h"

namespace gonio {
namespace {

constexpr int typical_orders = 16;  // of a table with all orders separate

// Peak memory beside the runs, measured (README, cost against size): the program, then heights, search maxima
// and what reading needs.
constexpr double program_bytes = 60 << 20, bytes_per_point = 46;

struct Size {
    double rows, slices, channels;
    double table_bytes() const { return rows * slices * channels * 3 * sizeof(double); }
    // The values of several stages, their moments, the text of a table while it is written.
    double working_bytes() const { return 5 * table_bytes(); }
};

Size size_of(const Material& material, const BrdfPlan& plan) {
    const double rows = plan.pairs.empty() ? static_cast<double>(plan.incident.size() * plan.outgoing.size())
                                           : static_cast<double>(plan.pairs.size());
    const double orders = plan.separate_orders ? (plan.max_order > 0 ? plan.max_order : typical_orders) : 0;
    return {rows, 1 + orders, static_cast<double>(material.channels.size())};
}

bool has_closed_form(const SimplifiedScene& simple) {
    const Lambertian* lambertian = pure_lambertian(simple.material);
    return lambertian && (lambertian->albedo.range().second == 0 ||
                          (is_plane(simple.surface) && !has_maps(simple.material)));
}

}  // namespace

Prediction predict_brdf(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                        long long max_bytes) {
    RunOptions options;
    options.max_bytes = max_bytes;
    const SimplifiedScene simple = simplify_brdf_scene(surface, material, options.allow_skips);
    const double cells = static_cast<double>(surface.nx) * surface.ny;
    const Size size = size_of(material, plan);
    Prediction prediction{0.05, program_bytes + bytes_per_point * cells + size.working_bytes(),
                          size.table_bytes()};
    if (has_closed_form(simple)) return prediction;

    const MarchGrid bounds = march_bounds(simple.surface);
    const MeasuredScene scene = brdf_scene(simple, bounds, plan, options);
    const TransportChoice choice = choose_transport(scene);
    prediction.cpu_seconds += choice.cost.cpu_seconds;
    if (plan.accuracy.max_seconds)
        prediction.cpu_seconds = plan.accuracy.target() > 0
                                     ? std::min(prediction.cpu_seconds, *plan.accuracy.max_seconds)
                                     : *plan.accuracy.max_seconds;
    // A run is cut to its share; K g of the whole period's runs is kept beside for the noise bias
    // (diffuse_transport.cpp).
    const RunSettings& settings = choice.cost.settings;
    prediction.memory_bytes +=
        std::min(choice.transport->wanted_bytes(settings), static_cast<double>(scene.max_bytes));
    if (choice.kind == TransportKind::diffuse && settings.tiles_x == 0 && plan.outgoing_cells.empty()) {
        const double columns = static_cast<double>(
            scene.view_to_light.empty() ? scene.lights.size() + scene.views.size() : scene.lights.size());
        const double kept = 8 * choice.cost.runs * columns * cells;
        if (kept < 0.1 * static_cast<double>(max_bytes)) prediction.memory_bytes += kept;
    }
    return prediction;
}

Prediction predict_reference(const HeightField& surface, const Material& material, const BrdfPlan& plan,
                             const ReferenceOptions& reference) {
    constexpr double rays_per_second = 4e6;
    const Size size = size_of(material, plan);
    const double bounces = plan.max_order > 0 ? plan.max_order : 1 + reflected_share(material),
                 rays = static_cast<double>(reference.paths) * static_cast<double>(plan.outgoing.size()) *
                        bounces * (1.0 + static_cast<double>(plan.incident.size()));
    return {0.05 + rays / rays_per_second,
            program_bytes + 250.0 * surface.nx * surface.ny + size.working_bytes(), size.table_bytes()};
}

}  // namespace gonio
