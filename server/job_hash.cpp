#include "server/job_hash.h"

#include <nlohmann/json.hpp>

#include "base/sha256.h"

namespace gonio {
namespace {

using nlohmann::json;  // sorts its keys, writes doubles as the shortest text that reads back

json angle_list(const std::vector<AnglesDeg>& directions) {
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

json canonical(const BrdfPlan& plan) {
    json j{{"kind", "brdf"},
           {"incident", angle_list(plan.incident)},
           {"outgoing", angle_list(plan.outgoing)},
           {"max_order", plan.max_order == 0 ? json("all") : json(plan.max_order)},
           {"orders", plan.separate_orders ? "separate" : "sum"},
           {"accuracy", canonical(plan.accuracy)}};
    if (!plan.pairs.empty()) j["pairs"] = plan.pairs;
    return j;
}

json canonical(const Lambertian& lambertian) {
    json j{{"model", "lambertian"}};
    if (lambertian.is_map()) {
        const int sizes[] = {lambertian.map_nx, lambertian.map_ny};
        j["albedo_map"] =
            sha256_hex({bytes_of(sizes, 2), bytes_of(lambertian.map.data(), lambertian.map.size())});
    } else {
        j["albedo"] = lambertian.albedo;
    }
    return j;
}

}  // namespace

std::string program_version() {
    return "gonio " GONIO_VERSION;
}

std::string canonical_job(const std::string& surface_hash, const Material& material, const MeasurePlan& plan,
                          const ReferenceOptions* reference) {
    json j{{"engine", program_version()},
           {"surface", surface_hash},
           {"material",
            std::visit([](const auto& reflectance) { return canonical(reflectance); }, material.reflectance)},
           {"measure", std::visit([](const auto& kind) { return canonical(kind); }, plan)}};
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
