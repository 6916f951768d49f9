#include "measure/transport.h"

#include "measure/diffuse_transport.h"

namespace gonio {
namespace {

struct Choice {
    TransportKind kind;
    std::string why;
};

Choice choose(const MeasuredScene& scene) {
    if (scene.plan->transport != TransportKind::automatic) return {scene.plan->transport, "asked for"};
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
    if (scene.surface->base.is_curved() && kind != TransportKind::diffuse)
        throw Error(ErrorCode::invalid_input, "/base", "",
                    std::string("only the light of Lambertian facets is carried over a curved base, not by ") +
                        name_of(kind));
    report.settings.push_back({"transport", name_of(kind)});
    report.settings.push_back({"transport_why", why});
    switch (kind) {
        case TransportKind::diffuse:
            return std::make_unique<DiffuseTransport>(scene, *lambertian, report);
        default:
            throw Error(ErrorCode::invalid_input, "/measure/transport", name_of(kind), "is not there yet");
    }
}

}  // namespace gonio
