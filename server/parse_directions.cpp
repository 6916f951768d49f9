// Directions and pairs of directions. Angles stay in degrees, as written: tables repeat the very numbers of
// the job.
#include <bit>
#include <cmath>
#include <set>
#include <unordered_map>

#include "base/error.h"
#include "directions/gonio_grid.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

constexpr size_t max_directions = 1 << 20;  // of one side

struct AnglesHash {
    size_t operator()(const AnglesDeg& a) const {
        const uint64_t t = std::bit_cast<uint64_t>(a.theta_deg), p = std::bit_cast<uint64_t>(a.phi_deg);
        return static_cast<size_t>((t * 0x9e3779b97f4a7c15u) ^ std::rotl(p * 0xc2b2ae3d27d4eb4fu, 31));
    }
};

// Unique directions in the order of their first appearance.
class DirectionIndex {
  public:
    int index_of(const AnglesDeg& direction) {
        const auto [entry, is_new] = index_.try_emplace(direction, static_cast<int>(directions_.size()));
        if (is_new) directions_.push_back(direction);
        return entry->second;
    }
    std::vector<AnglesDeg> take() { return std::move(directions_); }
    size_t size() const { return directions_.size(); }

  private:
    std::unordered_map<AnglesDeg, int, AnglesHash> index_;
    std::vector<AnglesDeg> directions_;
};

bool above_horizon(double theta_deg) {
    return theta_deg >= 0 && theta_deg < 90;
}
const std::string theta_allowed =
    "theta must be at least 0 and below 90 degrees: there is no direction at or below the horizon";

void check_size(const JsonNode& node, size_t n, size_t limit) {
    if (n <= limit) return;
    throw Error(ErrorCode::limit, node.path(), std::to_string(n) + " directions",
                "at most " + std::to_string(limit));
}

void refuse_repeated(const JsonNode& axis, const std::vector<double>& values) {
    std::set<double> seen;
    for (size_t i = 0; i < values.size(); ++i) {
        if (!seen.insert(values[i]).second) axis.element(i).refuse("is listed twice");
    }
}

std::vector<AnglesDeg> parse_product(const JsonNode& node) {
    node.allow_keys({"theta_deg", "phi_deg"});
    const JsonNode theta_node = node.at("theta_deg"), phi_node = node.at("phi_deg");
    const std::vector<double> theta_deg = theta_node.numbers(), phi_deg = phi_node.numbers();
    check_size(node, theta_deg.size() * phi_deg.size(), max_directions);
    for (size_t i = 0; i < theta_deg.size(); ++i) {
        if (!above_horizon(theta_deg[i])) theta_node.element(i).refuse(theta_allowed);
    }
    refuse_repeated(theta_node, theta_deg);
    refuse_repeated(phi_node, phi_deg);
    return product_grid(theta_deg, phi_deg);
}

std::vector<AnglesDeg> parse_list(const JsonNode& list) {
    const std::vector<double> angles = list.number_rows(2);
    check_size(list, angles.size() / 2, max_directions);
    DirectionIndex directions;
    for (size_t i = 0; 2 * i < angles.size(); ++i) {
        if (!above_horizon(angles[2 * i])) list.element(i).element(0).refuse(theta_allowed);
        if (directions.index_of({angles[2 * i], angles[2 * i + 1]}) != static_cast<int>(i)) {
            list.element(i).refuse("this direction is listed twice");
        }
    }
    return directions.take();
}

struct DirectionForm {
    std::string key;
    std::vector<AnglesDeg> (*parse)(const JsonNode& node);  // of the object that has this key
};

// A new way to name directions is one line here.
const std::vector<DirectionForm> direction_forms = {
    {"theta_deg", parse_product},
    {"list_deg",
     [](const JsonNode& node) {
         node.allow_keys({"list_deg"});
         return parse_list(node.at("list_deg"));
     }},
    {"hemisphere",
     [](const JsonNode& node) {
         node.allow_keys({"hemisphere"});
         return equal_projected_hemisphere(
             static_cast<int>(node.at("hemisphere").whole_number(1, max_directions)));
     }},
    {"klems",
     [](const JsonNode& node) {
         node.allow_keys({"klems"});
         node.at("klems").choice({"full"});
         return klems_full();
     }},
    {"bonn",
     [](const JsonNode& node) {
         node.allow_keys({"bonn"});
         const JsonNode size = node.at("bonn");
         const uint64_t n = size.whole_number(1, 151);
         if (n != 81 && n != 151) size.refuse("must be 81 or 151");
         return n == 81 ? bonn_81() : bonn_151();
     }},
};

// Receivers: {"cells": "klems_full"} or {"cells": {"equal": N}}.
std::vector<ReceiverCell> parse_cells(const JsonNode& outgoing) {
    outgoing.allow_keys({"cells"});
    const JsonNode node = outgoing.at("cells");
    if (node.raw().is_string()) {
        node.choice({"klems_full"});
        return klems_full_cells();
    }
    if (!node.raw().is_object()) node.refuse(R"(must be "klems_full" or {"equal": N})");
    node.allow_keys({"equal"});
    return equal_cells(static_cast<int>(node.at("equal").whole_number(1, max_directions)));
}

void parse_pairs(const JsonNode& node, BrdfPlan& plan) {
    const std::vector<double> angles = node.number_rows(4);
    DirectionIndex incident, outgoing;
    plan.pairs.reserve(angles.size() / 4);
    for (size_t r = 0; 4 * r < angles.size(); ++r) {
        const double* a = &angles[4 * r];
        if (!above_horizon(a[0])) node.element(r).element(0).refuse(theta_allowed);
        if (!above_horizon(a[2])) node.element(r).element(2).refuse(theta_allowed);
        plan.pairs.emplace_back(incident.index_of({a[0], a[1]}), outgoing.index_of({a[2], a[3]}));
    }
    check_size(node, std::max(incident.size(), outgoing.size()), max_directions);
    plan.incident = incident.take();
    plan.outgoing = outgoing.take();
}

}  // namespace

std::vector<AnglesDeg> parse_directions(const JsonNode& node) {
    if (const auto cells = node.find("cells"))
        cells->refuse(R"(receivers of finite size stand under "outgoing" of a brdf only)");
    for (const DirectionForm& form : direction_forms) {
        if (node.has(form.key)) return form.parse(node);
    }
    node.refuse(
        R"(must be one of {"theta_deg": [...], "phi_deg": [...]}, {"list_deg": [[theta, phi], ...]}, )"
        R"({"hemisphere": N}, {"klems": "full"} and {"bonn": 81})");
}

void parse_direction_pairs(const JsonNode& measure, BrdfPlan& plan) {
    if (const auto pairs = measure.find("pairs_deg")) {
        if (measure.has("incident") || measure.has("outgoing")) {
            pairs->refuse(R"(stands instead of "incident" and "outgoing": leave those out)");
        }
        parse_pairs(*pairs, plan);
        return;
    }
    plan.incident = parse_directions(measure.at("incident"));
    if (const JsonNode outgoing = measure.at("outgoing"); outgoing.has("cells")) {
        plan.outgoing_cells = parse_cells(outgoing);
        plan.outgoing = centres(plan.outgoing_cells);
    } else {
        plan.outgoing = parse_directions(outgoing);
    }
}

}  // namespace gonio
