// "measure": {"kind": "brdf", ...}
#include "base/error.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

constexpr size_t max_rows = 1u << 28;
constexpr uint64_t max_orders = 1000;

TransportKind parse_transport(const JsonNode& node) {
    const std::string name = node.choice({"auto", "diffuse", "pair_graph", "forward"});
    if (name == "diffuse") return TransportKind::diffuse;
    if (name == "pair_graph") return TransportKind::pair_graph;
    return name == "forward" ? TransportKind::forward : TransportKind::automatic;
}

}  // namespace

int parse_max_order(const JsonNode& measure) {
    const auto node = measure.find("max_order");
    if (!node) return 0;
    if (node->raw().is_string()) {
        if (node->raw() != "all") node->refuse(R"(must be "all" or a whole number from 1)");
        return 0;
    }
    return static_cast<int>(node->whole_number(1, max_orders));
}

BrdfPlan parse_brdf(const JsonNode& measure, const Accuracy& accuracy) {
    measure.allow_keys(
        {"kind", "incident", "outgoing", "pairs_deg", "max_order", "orders", "transport", "project"});
    BrdfPlan plan;
    plan.accuracy = accuracy;
    if (measure.has("project"))
        parse_projection(measure, plan);
    else
        parse_direction_pairs(measure, plan);
    if (const size_t rows = plan.incident.size() * plan.outgoing.size();
        plan.pairs.empty() && rows > max_rows) {
        throw Error(ErrorCode::limit, measure.path(), std::to_string(rows) + " pairs of directions",
                    "at most " + std::to_string(max_rows));
    }
    plan.max_order = parse_max_order(measure);
    if (const auto orders = measure.find("orders"))
        plan.separate_orders = orders->choice({"sum", "separate"}) == "separate";
    if (const auto transport = measure.find("transport")) plan.transport = parse_transport(*transport);
    return plan;
}

}  // namespace gonio
