#include "measure/transport_choice.h"

#include <algorithm>
#include <cmath>

#include "measure/describe.h"
#include "measure/diffuse_transport.h"
#include "measure/forward_transport.h"
#include "measure/graph_transport.h"

namespace gonio {
namespace {

bool has_mirror(const Material& material) {
    return std::any_of(material.lobes.begin(), material.lobes.end(),
                       [](const WeightedLobe& part) { return std::holds_alternative<Mirror>(part.lobe); });
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

void require_possible(TransportKind kind, const MeasuredScene& scene) {
    if (kind == TransportKind::diffuse && !pure_lambertian(*scene.material))
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
}

TransportChoice candidate(TransportKind kind, const MeasuredScene& scene) {
    require_possible(kind, scene);
    TransportChoice choice;
    choice.kind = kind;
    Report& report = choice.report;
    if (kind == TransportKind::diffuse)
        choice.transport =
            std::make_unique<DiffuseTransport>(scene, *pure_lambertian(*scene.material), report);
    else if (kind == TransportKind::pair_graph)
        choice.transport = std::make_unique<GraphTransport>(scene, report);
    else
        choice.transport = std::make_unique<ForwardTransport>(scene);
    choice.cost = foresee(*choice.transport, scene.plan->accuracy);
    return choice;
}

// By the kind of receiver, the facets and the base; at directions there is no choice.
std::vector<TransportKind> possible_kinds(const MeasuredScene& scene, std::string& why) {
    if (has_mirror(*scene.material)) {
        why = "facets are mirrors";
        return {TransportKind::forward};
    }
    const bool lambertian = pure_lambertian(*scene.material) != nullptr;
    const TransportKind connected = lambertian ? TransportKind::diffuse : TransportKind::pair_graph;
    why = lambertian ? "all facets are Lambertian" : "facets are glossy";
    if (scene.plan->outgoing_cells.empty() || scene.surface->base.is_curved()) return {connected};
    return {connected, TransportKind::forward};
}

std::string in_words(const TransportChoice& choice) {
    return std::string(name_of(choice.kind)) + ": foreseen " + number(100 * choice.cost.relative_error) +
           " % in " + number(choice.cost.cpu_seconds) + " s";
}

}  // namespace

TransportCost foresee(const Transport& transport, const Accuracy& accuracy) {
    constexpr int most_steps = 16;
    const double target = accuracy.target() > 0 ? accuracy.target() : Accuracy::default_target;
    Stage stage;
    stage.settings =
        accuracy.samples ? transport.settings_of(*accuracy.samples) : transport.first_settings(target);
    int runs = accuracy.samples ? std::max(2, accuracy.samples->replicates) : runs_at_first;
    TransportCost cost;
    for (int n = 1;; ++n) {
        const RunForecast run = transport.forecast(stage.settings);
        cost.settings = stage.settings;
        cost.cpu_seconds += run.cpu_seconds * (runs - stage.f.count());
        cost.runs += runs - stage.f.count();
        while (stage.f.count() < runs) stage.f.add({});
        Estimate e;
        e.direct = run.direct / std::sqrt(runs);
        e.random = std::hypot(run.direct, run.indirect) / std::sqrt(runs);
        e.systematic = run.lasting;
        e.total = std::hypot(e.random, e.systematic);
        cost.relative_error = std::hypot(e.total, run.untold);
        if (accuracy.samples || e.total <= target || n == most_steps) return cost;
        const NextStep step = transport.next_step(stage, e, target);
        if (!step.possible) return cost;
        if (step.more_runs > 0) {
            runs += step.more_runs;
        } else {
            stage = Stage();
            stage.settings = step.settings;
            runs = runs_at_first;
        }
    }
}

TransportChoice choose_transport(const MeasuredScene& scene) {
    const BrdfPlan& plan = *scene.plan;
    std::string why = "asked for";
    std::vector<TransportKind> kinds{plan.transport};
    if (plan.transport == TransportKind::automatic) kinds = possible_kinds(scene, why);
    std::vector<TransportChoice> choices;
    for (const TransportKind kind : kinds) choices.push_back(candidate(kind, scene));
    const double target = plan.accuracy.target() > 0 ? plan.accuracy.target() : Accuracy::default_target;
    // A target that is out of reach is a target missed, however soon.
    auto worse = [&](const TransportChoice& a, const TransportChoice& b) {
        const double error_a = a.cost.relative_error, error_b = b.cost.relative_error;
        if (plan.accuracy.samples) return error_a > error_b;
        const bool misses_a = error_a > target, misses_b = error_b > target;
        return misses_a != misses_b ? misses_a : a.cost.cpu_seconds > b.cost.cpu_seconds;
    };
    size_t best = 0;
    for (size_t k = 1; k < choices.size(); ++k)
        if (worse(choices[best], choices[k])) best = k;
    if (choices.size() > 1) {
        why = in_words(choices[best]);
        for (size_t k = 0; k < choices.size(); ++k)
            if (k != best) why += "; " + in_words(choices[k]);
    }
    TransportChoice& choice = choices[best];
    choice.report.settings = {{"transport", name_of(choice.kind)}, {"transport_why", why}};
    return std::move(choice);
}

}  // namespace gonio
