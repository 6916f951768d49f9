#include "measure/transport.h"

#include <algorithm>

#include "measure/diffuse_transport.h"
#include "measure/forward_transport.h"
#include "measure/graph_transport.h"

namespace gonio {
namespace {

struct Choice {
    TransportKind kind;
    std::string why;
};

bool has_mirror(const Material& material) {
    return std::any_of(material.lobes.begin(), material.lobes.end(),
                       [](const WeightedLobe& part) { return std::holds_alternative<Mirror>(part.lobe); });
}

Choice choose(const MeasuredScene& scene) {
    if (scene.plan->transport != TransportKind::automatic) return {scene.plan->transport, "asked for"};
    // Forward tracing sees flat bases alone.
    if (!scene.plan->outgoing_cells.empty() && !scene.surface->base.is_curved())
        return {TransportKind::forward, "the receivers are cells"};
    if (has_mirror(*scene.material)) return {TransportKind::forward, "facets are mirrors"};
    if (pure_lambertian(*scene.material)) return {TransportKind::diffuse, "all facets are Lambertian"};
    return {TransportKind::pair_graph, "facets are glossy"};
}

const char* name_of(TransportKind kind) {
    switch (kind) {
        case TransportKind::automatic:
            return "auto";
        case TransportKind::diffuse:
            return "diffuse operator";
        case TransportKind::pair_graph:
            return "pair graph";
        case TransportKind::forward:
            return "forward tracing";
    }
    return "auto";
}

}  // namespace

std::unique_ptr<Transport> make_transport(const MeasuredScene& scene, Report& report) {
    const auto [kind, why] = choose(scene);
    const Lambertian* lambertian = pure_lambertian(*scene.material);
    if (kind == TransportKind::diffuse && !lambertian)
        throw Error(ErrorCode::invalid_input, "/measure/transport", "diffuse",
                    "carries the light of Lambertian facets alone; leave it to \"auto\"");
    if (scene.surface->base.is_curved() && kind == TransportKind::forward)
        throw Error(ErrorCode::invalid_input, "/base", "",
                    std::string("light is not traced forward over a curved base") +
                        (has_mirror(*scene.material) ? ", and nothing else takes mirrors"
                                                     : R"(: leave "transport" to "auto")"));
    const std::string cells = R"({"cells": "klems_full"} or {"cells": {"equal": N}})";
    if (scene.plan->outgoing_cells.empty() && has_mirror(*scene.material))
        throw Error(ErrorCode::invalid_input, "/measure/outgoing", "directions",
                    "a mirror's f is infinite or 0 at a direction: needs receivers of finite size, " + cells);
    if (kind == TransportKind::forward && scene.plan->outgoing_cells.empty())
        throw Error(ErrorCode::invalid_input, "/measure/transport", "forward",
                    "needs \"outgoing\": receivers of finite size, " + cells);
    if (kind == TransportKind::pair_graph && has_mirror(*scene.material))
        throw Error(ErrorCode::invalid_input, "/measure/transport", "pair_graph",
                    "carries no mirrors: leave it to \"auto\", or take \"forward\"");
    report.settings.push_back({"transport", name_of(kind)});
    report.settings.push_back({"transport_why", why});
    switch (kind) {
        case TransportKind::diffuse:
            return std::make_unique<DiffuseTransport>(scene, *lambertian, report);
        case TransportKind::forward:
            return std::make_unique<ForwardTransport>(scene);
        case TransportKind::pair_graph:
            return std::make_unique<GraphTransport>(scene, report);
        case TransportKind::automatic:
            break;
    }
    throw Error(ErrorCode::internal, "/measure/transport", name_of(kind), "was not chosen");
}

}  // namespace gonio
