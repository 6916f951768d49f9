#include "fitting/projection_directions.h"

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "directions/hemisphere_quadrature.h"

namespace gonio {
namespace {

constexpr double least_cos = 1e-3;  // what is seen at less says nothing about the rest

AnglesDeg angles_at(double z, double turns) {
    return {degrees(std::acos(std::max(z, least_cos))), 360 * fractional_part(turns)};
}

// Streams of random numbers.
enum : uint64_t { view_stream = 0x5348, light_stream, pair_stream, turn_stream, twin_stream };

// Step k of Roberts's additive recurrence in d dimensions: x_j = k / g^(j + 1) with g^(d + 1) = g + 1, the
// golden ratio for d = 1.
double recurrence(int k, int dimension, int of_dimensions) {
    double g = 1.2;
    for (int step = 0; step < 60; ++step) g = std::pow(1 + g, 1.0 / (of_dimensions + 1));
    return fractional_part(k * std::pow(g, -(dimension + 1)));
}

// Isotropic functions depend on both thetas and phi_i - phi_o: these three are spread evenly, the turn that
// is left is random. Independent pairs have a condition number of 46 (order 8, 400 samples) instead of 5.
void set_pairs(BrdfPlan& plan) {
    const ProjectionPlan& project = *plan.project;
    const uint64_t seed = plan.accuracy.seed;
    const auto add = [&plan](const AnglesDeg& wi, const AnglesDeg& wo) {
        plan.pairs.emplace_back(plan.incident.size(), plan.outgoing.size());
        plan.incident.push_back(wi);
        plan.outgoing.push_back(wo);
    };
    const auto shift = random_words(seed, pair_stream, 0);
    const int dimensions = project.isotropic ? 3 : 4;
    for (int k = 0; k < project.samples; ++k) {
        double x[4] = {0, 0, 0, uniform_double(random_words(seed, turn_stream, k)[0])};
        for (int d = 0; d < dimensions; ++d)
            x[d] = fractional_part(uniform_double(shift[d]) + recurrence(k, d, dimensions));
        add(angles_at(1 - x[0], x[3]), angles_at(1 - x[1], project.isotropic ? x[3] + x[2] : x[2]));
    }
    for (int k = 0; k < isotropy_twins(project); ++k) {
        const double turn_deg = 360 * uniform_double(random_words(seed, twin_stream, k)[0]);
        const auto turned = [turn_deg](const AnglesDeg& a) {
            return AnglesDeg{a.theta_deg, std::fmod(a.phi_deg + turn_deg, 360)};
        };
        const AnglesDeg wi = plan.incident[k], wo = plan.outgoing[k];
        add(turned(wi), turned(wo));
    }
}

}  // namespace

std::vector<AnglesDeg> scattered_directions(int n, uint64_t seed, uint64_t stream) {
    const auto words = random_words(seed, stream, 0);
    std::vector<AnglesDeg> directions;
    directions.reserve(n);
    for (int k = 0; k < n; ++k)
        directions.push_back(angles_at(1 - (k + uniform_double(words[0])) / n,
                                       uniform_double(words[1]) + k * (std::numbers::phi - 1)));
    return directions;
}

ProjectionGrid projection_grid(int order) {
    const DirectionSet set = hemisphere_quadrature(2 * order, 4 * order);
    ProjectionGrid grid{{}, set.solid_angle};
    for (const Vec3& w : set.directions)
        grid.directions.push_back(angles_at(w.z, std::atan2(w.y, w.x) / (2 * pi)));
    return grid;
}

ProjectionGrid isotropic_lights(int order) {
    const Quadrature rule = gauss_legendre(2 * order, 0, 1);
    ProjectionGrid lights;
    for (int k = 0; k < 2 * order; ++k) {
        lights.directions.push_back(angles_at(rule.nodes[k], k * (std::numbers::phi - 1)));
        lights.solid_angle.push_back(2 * pi * rule.weights[k]);
    }
    return lights;
}

int isotropy_twins(const ProjectionPlan& plan) {
    return plan.form == ProjectionPlan::Form::joint && plan.isotropic ? plan.samples / 8 : 0;
}

void set_projection_directions(BrdfPlan& plan) {
    const ProjectionPlan& project = *plan.project;
    using Form = ProjectionPlan::Form;
    plan.pairs.clear();
    if (project.form != Form::per_light) plan.incident.clear();
    plan.outgoing.clear();
    if (project.samples > 0) {
        if (project.form == Form::joint) return set_pairs(plan);
        plan.outgoing = scattered_directions(project.samples, plan.accuracy.seed, view_stream);
        if (project.form == Form::matrix)
            plan.incident = scattered_directions(project.samples, plan.accuracy.seed, light_stream);
        return;
    }
    plan.outgoing = projection_grid(project.order).directions;
    if (project.form == Form::joint && project.isotropic)
        plan.incident = isotropic_lights(project.order).directions;
    else if (project.form != Form::per_light)
        plan.incident = plan.outgoing;
}

}  // namespace gonio
