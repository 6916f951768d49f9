#include "server/job_hash.h"

#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "material/lobe_parameters.h"
#include "server/canonical.h"
#include "server/measure_kind.h"

namespace gonio {

using nlohmann::json;  // sorts its keys, writes doubles as the shortest text that reads back

json canonical(const std::vector<AnglesDeg>& directions) {
    json list = json::array();
    for (const AnglesDeg& a : directions) list.push_back({a.theta_deg, a.phi_deg});
    return list;
}

json canonical(const Accuracy& accuracy) {
    json j{{"seed", accuracy.seed}};
    if (accuracy.target_relative_error) j["target_relative_error"] = *accuracy.target_relative_error;
    if (accuracy.max_seconds) j["max_seconds"] = *accuracy.max_seconds;
    if (accuracy.samples) {
        j["samples"] = {{"sub_samples", accuracy.samples->sub_samples},
                        {"directions", accuracy.samples->directions},
                        {"refinement", accuracy.samples->refinement},
                        {"replicates", accuracy.samples->replicates}};
    }
    return j;
}

json canonical(const ProjectionPlan& plan) {
    using Form = ProjectionPlan::Form;
    json j{{"basis", plan.basis == ProjectionPlan::Basis::sh ? "sh" : "hsh"},
           {"order", plan.order},
           {"weighting", plan.weighting == ProjectionPlan::Weighting::cosine ? "cosine" : "none"},
           {"form", plan.form == Form::per_light ? "per_light" : plan.form == Form::matrix ? "matrix" : "joint"}};
    if (plan.samples > 0) j["samples"] = plan.samples;
    if (plan.form == Form::joint) j["isotropic"] = plan.isotropic;
    return j;
}

json canonical(const BrdfPlan& plan) {
    json j{{"kind", "brdf"},
           {"incident", canonical(plan.incident)},
           {"outgoing", canonical(plan.outgoing)},
           {"max_order", plan.max_order == 0 ? json("all") : json(plan.max_order)},
           {"orders", plan.separate_orders ? "separate" : "sum"},
           {"accuracy", canonical(plan.accuracy)}};
    if (!plan.pairs.empty()) j["pairs"] = plan.pairs;
    if (plan.transport != TransportKind::automatic) j["transport"] = static_cast<int>(plan.transport);
    for (const ReceiverCell& c : plan.outgoing_cells)
        j["cells"].push_back({c.theta_min_deg, c.theta_max_deg, c.phi_min_deg, c.phi_max_deg});
    if (plan.project) j["project"] = canonical(*plan.project);
    return j;
}

namespace {

// One value or plane for each channel it may differ in: what is alike has one hash.
void add_parameter(json& j, const std::string& name, const Parameter& parameter, size_t n_channels) {
    const Parameter all = parameter.for_channels(n_channels);
    if (all.is_map()) {
        const int sizes[] = {all.map_nx, all.map_ny};
        j[name + "_map"] = sha256_hex({bytes_of(sizes, 2), bytes_of(all.map.data(), all.map.size())});
    } else {
        j[name] = all.constant;
    }
}

const char* model_name(const Lambertian&) {
    return "lambertian";
}
const char* model_name(const Phong&) {
    return "phong";
}
const char* model_name(const BlinnPhong&) {
    return "blinn_phong";
}
const char* model_name(const Microfacet& lobe) {
    return lobe.distribution == Microfacet::Distribution::ggx ? "ggx" : "beckmann";
}
const char* model_name(const CoatedDiffuse&) {
    return "coated_diffuse";
}
const char* model_name(const Mirror&) {
    return "mirror";
}

json canonical(const Lobe& lobe, size_t n_channels) {
    return std::visit(
        [&](const auto& kind) {
            json j{{"model", model_name(kind)}};
            visit_parameters(kind,
                             [&](const char* name, const Parameter& parameter, const ParameterRange& range) {
                                 add_parameter(j, name, parameter, range.by_channel ? n_channels : 1);
                             });
            return j;
        },
        lobe);
}

json canonical(const Material& material) {
    const size_t n = material.channels.size();
    const WeightedLobe& first = material.lobes.front();
    if (material.lobes.size() == 1 && !first.weight.is_map() && first.weight.range().first == 1)
        return canonical(first.lobe, n);
    json parts = json::array();
    for (const WeightedLobe& part : material.lobes) {
        json j = canonical(part.lobe, n);
        add_parameter(j, "weight", part.weight, n);
        parts.push_back(std::move(j));
    }
    return {{"model", "mixture"}, {"parts", std::move(parts)}};
}

}  // namespace

std::string program_version() {
    return "gonio " GONIO_VERSION;
}

std::string canonical_job(const std::string& surface_hash, const Material& material, const MeasurePlan& plan,
                          const ReferenceOptions* reference) {
    json j{{"engine", program_version()},
           {"surface", surface_hash},
           {"material", canonical(material)},
           {"measure", kind_of(plan).canonical(plan)}};
    j["material"]["channels"] = material.channels;
    if (reference) j["reference"] = {{"paths", reference->paths}};
    return j.dump();
}

std::string job_hash(const std::string& surface_hash, const Material& material, const MeasurePlan& plan,
                     const ReferenceOptions* reference) {
    return sha256_hex(canonical_job(surface_hash, material, plan, reference));
}

std::string runs_hash(const std::string& surface_hash, const Material& material, MeasurePlan plan,
                      const ReferenceOptions* reference) {
    std::visit(
        [](auto& kind) {
            kind.accuracy.target_relative_error.reset();
            kind.accuracy.max_seconds.reset();
        },
        plan);
    return job_hash(surface_hash, material, plan, reference);
}

}  // namespace gonio
