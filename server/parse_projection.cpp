// "project" of "measure": {"kind": "brdf", ...}: which spherical harmonics, from what.
#include "base/error.h"
#include "directions/spherical_harmonics.h"
#include "fitting/projection_directions.h"
#include "fitting/sh_projection.h"
#include "server/job_sections.h"

namespace gonio {
namespace {

using Form = ProjectionPlan::Form;

constexpr uint64_t max_samples = 1 << 16;

Form parse_form(const JsonNode& node) {
    const std::string name = node.choice({"per_light", "matrix", "joint"});
    return name == "per_light" ? Form::per_light : name == "matrix" ? Form::matrix : Form::joint;
}

void check_samples(const JsonNode& samples, const ProjectionPlan& plan) {
    const long long least = least_samples(plan);
    if (plan.samples >= least) return;
    samples.refuse("too few: order " + std::to_string(plan.order) + " has " + std::to_string(least) +
                   (plan.form == Form::joint ? " unknowns" : " unknowns a side") + ", so at least " +
                   std::to_string(least) + " samples are needed; lower the order or take more");
}

}  // namespace

void parse_projection(const JsonNode& measure, BrdfPlan& plan) {
    const JsonNode node = measure.at("project");
    node.allow_keys({"basis", "order", "samples", "weighting", "form", "isotropic"});
    ProjectionPlan project;
    if (const auto basis = node.find("basis"))
        project.basis =
            basis->choice({"sh", "hsh"}) == "sh" ? ProjectionPlan::Basis::sh : ProjectionPlan::Basis::hsh;
    if (const auto order = node.find("order"))
        project.order = static_cast<int>(order->whole_number(1, max_harmonic_order));
    if (const auto weighting = node.find("weighting"))
        project.weighting = weighting->choice({"none", "cosine"}) == "none"
                                ? ProjectionPlan::Weighting::none
                                : ProjectionPlan::Weighting::cosine;
    if (const auto form = node.find("form")) project.form = parse_form(*form);
    if (const auto isotropic = node.find("isotropic")) {
        if (project.form != Form::joint) isotropic->refuse(R"(is a property of "form": "joint")");
        project.isotropic = isotropic->boolean();
    }
    try {
        check_projection(project);
    } catch (const Error& error) {
        throw Error(error.code(), node.path() + "/" + error.field(), error.value(), error.allowed());
    }
    if (const auto samples = node.find("samples")) {
        project.samples = static_cast<int>(samples->whole_number(1, max_samples));
        check_samples(*samples, project);
    }
    for (const char* key : {"outgoing", "pairs_deg"})
        if (const auto given = measure.find(key))
            given->refuse(R"("project" chooses these directions: leave this out)");
    if (const auto incident = measure.find("incident")) {
        if (project.form != Form::per_light)
            incident->refuse(
                R"("project" chooses these directions unless its "form" is "per_light": leave this out)");
        plan.incident = parse_directions(*incident);
    } else if (project.form == Form::per_light) {
        static_cast<void>(measure.at("incident"));
    }
    plan.project = project;
    set_projection_directions(plan);
}

}  // namespace gonio
