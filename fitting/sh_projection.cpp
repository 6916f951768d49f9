#include "fitting/sh_projection.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "directions/hemisphere_quadrature.h"
#include "directions/spherical_harmonics.h"
#include "fitting/joint_basis.h"
#include "fitting/projection_directions.h"
#include "fitting/ridge_fit.h"

namespace gonio {
namespace {

using Basis = ProjectionPlan::Basis;
using Form = ProjectionPlan::Form;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr long long max_unknowns = 4096, max_design_entries = 1LL << 27;

void harmonics(const ProjectionPlan& plan, const AnglesDeg& direction, std::span<double> y) {
    (plan.basis == Basis::hsh ? hsh_basis : sh_basis)(plan.order, to_vector(direction), y);
}

// A row a direction.
MatrixXd harmonics_of(const ProjectionPlan& plan, const std::vector<AnglesDeg>& directions) {
    MatrixXd rows(directions.size(), harmonic_count(plan.order));
    std::vector<double> y(harmonic_count(plan.order));
    for (size_t d = 0; d < directions.size(); ++d) {
        harmonics(plan, directions[d], y);
        rows.row(static_cast<Eigen::Index>(d)) = Eigen::Map<Eigen::RowVectorXd>(y.data(), rows.cols());
    }
    return rows;
}

// <y_a, y_b> over the upper hemisphere.
MatrixXd upper_gram(const ProjectionPlan& plan) {
    const ProjectionGrid grid = projection_grid(plan.order);
    const MatrixXd y = harmonics_of(plan, grid.directions);
    const Eigen::Map<const VectorXd> weights(grid.solid_angle.data(), y.rows());
    return y.transpose() * weights.asDiagonal() * y;
}

// Of what zeros_below() needs it for.
MatrixXd gram_for_zeros(const ProjectionPlan& plan) {
    return plan.basis == Basis::sh && plan.samples > 0 ? upper_gram(plan) : MatrixXd();
}

// The zeros of SH where light or view lies below the horizon, as many as n samples above it stand for;
// nothing for HSH, which are not defined there. gram: of the fitted functions over what lies above;
// solid_angle: of that.
MatrixXd zeros_below(const ProjectionPlan& plan, const MatrixXd& gram, double n, double solid_angle) {
    if (plan.basis == Basis::hsh) return {};
    return n / solid_angle * (MatrixXd::Identity(gram.rows(), gram.cols()) - gram);
}

double weight_of(const ProjectionPlan& plan, const AnglesDeg& wi, const AnglesDeg& wo) {
    return plan.weighting == ProjectionPlan::Weighting::none ? 1 : to_vector(wi).z * to_vector(wo).z;
}

size_t light_index(const HarmonicProjection& projection, const AnglesDeg& light) {
    const auto found = std::find(projection.incident.begin(), projection.incident.end(), light);
    if (found != projection.incident.end()) return static_cast<size_t>(found - projection.incident.begin());
    throw Error(ErrorCode::invalid_input, "incident",
                "[" + number_text(light.theta_deg) + ", " + number_text(light.phi_deg) + "]",
                "is no light of this projection, which has one set of coefficients a light");
}

// One channel and slice of the table, multiplied by what the weighting says; rows as in the table.
struct Samples {
    VectorXd g, se, bias;
};
Samples samples_of(const Table& table, const VectorXd& weight, size_t channel, size_t slice) {
    const auto n = static_cast<Eigen::Index>(table.rows());
    const size_t first = table.index(channel, slice, 0);
    const auto column = [&](const std::vector<float>& values) {
        return VectorXd(
            Eigen::Map<const Eigen::VectorXf>(&values[first], n).cast<double>().cwiseProduct(weight));
    };
    return {column(table.f), column(table.se), column(table.bias)};
}

double relative(double squared_error, double squared_value) {
    return squared_value > 0 ? std::sqrt(squared_error / squared_value) : 0;
}

// The coefficients of one set, linear in the samples: c = estimator g.
void store(HarmonicProjection& result, size_t set_index, const MatrixXd& estimator, const VectorXd& g,
           const VectorXd& se, const VectorXd& bias) {
    const auto n = static_cast<Eigen::Index>(result.n_coefficients());
    const auto place = [&](std::vector<double>& values) {
        return Eigen::Map<VectorXd>(&values[set_index * static_cast<size_t>(n)], n);
    };
    place(result.coefficients) = estimator * g;
    place(result.se) = (estimator.cwiseAbs2() * se.cwiseAbs2()).cwiseSqrt();
    place(result.bias) = estimator.cwiseAbs() * bias;
}

// Coefficients from the grid that set_projection_directions() gave: c = B^T W g.
class GridEstimator {
  public:
    GridEstimator(MatrixXd basis, VectorXd weights) : basis_(std::move(basis)), weights_(std::move(weights)) {
        estimator_ = basis_.transpose() * weights_.asDiagonal();
    }
    const MatrixXd& estimator() const { return estimator_; }
    double relative_error(const VectorXd& g) const {
        const VectorXd error = basis_ * (estimator_ * g) - g;
        return relative(weights_.dot(error.cwiseAbs2()), weights_.dot(g.cwiseAbs2()));
    }

  private:
    MatrixXd basis_, estimator_;
    VectorXd weights_;
};

void check_grid(const std::vector<AnglesDeg>& found, const ProjectionGrid& grid, const char* side) {
    bool same = found.size() == grid.directions.size();
    for (size_t k = 0; same && k < found.size(); ++k)
        same = dot(to_vector(found[k]), to_vector(grid.directions[k])) > 1 - 1e-12;
    if (!same)
        throw Error(ErrorCode::invalid_input, side, std::to_string(found.size()) + " directions",
                    "are not the quadrature grid of this order; project them as samples");
}

VectorXd as_vector(const std::vector<double>& values) {
    return Eigen::Map<const VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

void check_samples(long long n, const ProjectionPlan& plan, const char* of) {
    if (n >= least_samples(plan)) return;
    throw Error(ErrorCode::invalid_input, "samples", std::to_string(n) + of,
                "at least " + std::to_string(least_samples(plan)) +
                    " are needed for so many unknowns of order " + std::to_string(plan.order));
}

// Runs body(channel, slice, samples) for every column of the table.
template <class Body>
void for_each_slice(const Table& table, const VectorXd& weight, Body&& body) {
    for (size_t channel = 0; channel < table.channels.size(); ++channel)
        for (size_t slice = 0; slice < table.slices(); ++slice)
            body(channel, slice, samples_of(table, weight, channel, slice));
}

void project_per_light(const Table& table, const VectorXd& weight, HarmonicProjection& result) {
    const ProjectionPlan& plan = result.plan;
    std::vector<std::vector<Eigen::Index>> rows_of(table.incident.size());
    std::vector<std::vector<AnglesDeg>> views(table.incident.size());
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        rows_of[i].push_back(static_cast<Eigen::Index>(row));
        views[i].push_back(table.outgoing[o]);
    }
    std::optional<RidgeFit> fit;
    std::optional<GridEstimator> grid;
    if (plan.samples == 0) {
        const ProjectionGrid nodes = projection_grid(plan.order);
        check_grid(table.outgoing, nodes, "outgoing");
        grid.emplace(harmonics_of(plan, nodes.directions), as_vector(nodes.solid_angle));
    }
    const MatrixXd gram = gram_for_zeros(plan);
    for (size_t light = 0; light < views.size(); ++light) {
        // Lights of a full product share their views, and so the design.
        if (!grid && (light == 0 || views[light] != views[light - 1])) {
            const auto n = static_cast<double>(views[light].size());
            check_samples(static_cast<long long>(n), plan, " views of a light");
            fit.emplace(harmonics_of(plan, views[light]), zeros_below(plan, gram, n, 2 * pi));
            result.condition_number = std::max(result.condition_number, fit->condition_number());
        }
        for_each_slice(table, weight, [&](size_t channel, size_t slice, const Samples& all) {
            const Samples own{all.g(rows_of[light]), all.se(rows_of[light]), all.bias(rows_of[light])};
            const size_t set = result.set_index(channel, slice, light);
            if (grid) {
                store(result, set, grid->estimator(), own.g, own.se, own.bias);
                result.relative_error[set] = grid->relative_error(own.g);
                return;
            }
            const int ridge = fit->best_ridge(own.g);
            store(result, set, fit->estimator(ridge), own.g, own.se, own.bias);
            result.ridge[set] = fit->ridges()[ridge];
            result.relative_error[set] =
                relative(fit->held_out_errors(own.g, ridge).squaredNorm(), own.g.squaredNorm());
        });
    }
}

// The design is the product of those of both sides, and so is everything made of it: no matrix of order^4
// unknowns is solved.
void project_matrix(const Table& table, const VectorXd& weight, HarmonicProjection& result) {
    const ProjectionPlan& plan = result.plan;
    if (!table.pairs.empty())
        throw Error(ErrorCode::invalid_input, "form", "matrix",
                    "needs every incident with every outgoing direction");
    const auto n_i = static_cast<Eigen::Index>(table.incident.size()),
               n_o = static_cast<Eigen::Index>(table.outgoing.size());
    const MatrixXd y_i = harmonics_of(plan, table.incident), y_o = harmonics_of(plan, table.outgoing);
    std::optional<RidgeFit> fit_i, fit_o;
    MatrixXd grid_estimator;
    VectorXd weights;
    if (plan.samples == 0) {
        const ProjectionGrid grid = projection_grid(plan.order);
        check_grid(table.incident, grid, "incident");
        check_grid(table.outgoing, grid, "outgoing");
        weights = as_vector(grid.solid_angle);
        grid_estimator = y_o.transpose() * weights.asDiagonal();
    } else {
        check_samples(n_i, plan, " lights");
        check_samples(n_o, plan, " views");
        const MatrixXd gram = gram_for_zeros(plan);
        fit_i.emplace(y_i, zeros_below(plan, gram, static_cast<double>(n_i), 2 * pi));
        fit_o.emplace(y_o, zeros_below(plan, gram, static_cast<double>(n_o), 2 * pi));
        result.condition_number = fit_i->condition_number() * fit_o->condition_number();
    }
    for_each_slice(table, weight, [&](size_t channel, size_t slice, const Samples& samples) {
        const auto by_light = [&](const VectorXd& column) {
            return Eigen::Map<const RowMajor>(column.data(), n_i, n_o);
        };
        const MatrixXd g = by_light(samples.g);
        const size_t set = result.set_index(channel, slice, 0);
        MatrixXd e_i = grid_estimator, e_o = grid_estimator;
        if (fit_i) {
            const int ridge_o = fit_o->best_ridge(g.transpose());
            e_o = fit_o->estimator(ridge_o);
            const int ridge_i = fit_i->best_ridge(g * e_o.transpose());
            e_i = fit_i->estimator(ridge_i);
            result.ridge[set] = fit_o->ridges()[ridge_o];
            // Both the light and the view of each value held out.
            const MatrixXd error =
                fit_i->leave_one_out(ridge_i) * g * fit_o->leave_one_out(ridge_o).transpose() - g;
            result.relative_error[set] = relative(error.squaredNorm(), g.squaredNorm());
        } else {
            const MatrixXd error = y_i * (e_i * g * e_o.transpose()) * y_o.transpose() - g;
            const auto sum = [&](const MatrixXd& m) { return weights.dot(m.cwiseAbs2() * weights); };
            result.relative_error[set] = relative(sum(error), sum(g));
        }
        const auto n = static_cast<Eigen::Index>(harmonic_count(plan.order));
        const auto place = [&](std::vector<double>& values) {
            return Eigen::Map<RowMajor>(&values[set * result.n_coefficients()], n, n);
        };
        place(result.coefficients) = e_i * g * e_o.transpose();
        place(result.se) =
            (e_i.cwiseAbs2() * by_light(samples.se).cwiseAbs2() * e_o.cwiseAbs2().transpose()).cwiseSqrt();
        place(result.bias) = e_i.cwiseAbs() * by_light(samples.bias) * e_o.cwiseAbs().transpose();
    });
}

void measure_isotropy(const Table& table, const VectorXd& weight, Eigen::Index n,
                      HarmonicProjection& result) {
    double difference = 0, noise = 0, total = 0;
    for_each_slice(table, weight, [&](size_t, size_t slice, const Samples& samples) {
        if (slice > 0) return;
        const Eigen::Index twins = samples.g.size() - n;
        difference += (samples.g.tail(twins) - samples.g.head(twins)).squaredNorm();
        noise += samples.se.tail(twins).squaredNorm() + samples.se.head(twins).squaredNorm();
        total += samples.g.head(twins).squaredNorm();
    });
    result.isotropy_defect = {relative(difference, total), relative(noise, total)};
}

void project_joint(const Table& table, const VectorXd& weight, HarmonicProjection& result) {
    const ProjectionPlan& plan = result.plan;
    const std::vector<JointFunction> functions = joint_basis(plan.order, plan.isotropic);
    const auto twins = static_cast<size_t>(isotropy_twins(plan));
    const bool has_twins = twins > 0 && table.rows() == static_cast<size_t>(plan.samples) + twins;
    const size_t n = table.rows() - (has_twins ? twins : 0);
    if (static_cast<long long>(n * functions.size()) > max_design_entries)
        throw Error(ErrorCode::limit, "order", std::to_string(plan.order),
                    std::to_string(n) + " values times " + std::to_string(functions.size()) +
                        " unknowns need more than 1 GiB: lower the order, or take fewer samples");
    const MatrixXd y_i = harmonics_of(plan, table.incident), y_o = harmonics_of(plan, table.outgoing);
    MatrixXd rows_i(n, y_i.cols()), rows_o(n, y_o.cols());
    for (size_t row = 0; row < n; ++row) {
        rows_i.row(static_cast<Eigen::Index>(row)) = y_i.row(table.pair(row).first);
        rows_o.row(static_cast<Eigen::Index>(row)) = y_o.row(table.pair(row).second);
    }
    MatrixXd design = joint_design(functions, rows_i, rows_o);
    std::optional<RidgeFit> fit;
    std::optional<GridEstimator> grid;
    if (plan.samples == 0) {
        const ProjectionGrid views = projection_grid(plan.order),
                             lights = plan.isotropic ? isotropic_lights(plan.order) : views;
        check_grid(table.outgoing, views, "outgoing");
        check_grid(table.incident, lights, "incident");
        VectorXd weights(n);
        for (size_t row = 0; row < n; ++row)
            weights[static_cast<Eigen::Index>(row)] =
                lights.solid_angle[table.pair(row).first] * views.solid_angle[table.pair(row).second];
        grid.emplace(std::move(design), std::move(weights));
    } else {
        check_samples(static_cast<long long>(n), plan, " pairs");
        const MatrixXd gram = plan.basis == Basis::sh ? joint_gram(functions, upper_gram(plan)) : MatrixXd();
        fit.emplace(design, zeros_below(plan, gram, static_cast<double>(n), 4 * pi * pi));
        result.condition_number = fit->condition_number();
    }
    for_each_slice(table, weight, [&](size_t channel, size_t slice, const Samples& all) {
        const auto rows = static_cast<Eigen::Index>(n);
        const VectorXd g = all.g.head(rows), se = all.se.head(rows), bias = all.bias.head(rows);
        const size_t set = result.set_index(channel, slice, 0);
        if (grid) {
            store(result, set, grid->estimator(), g, se, bias);
            result.relative_error[set] = grid->relative_error(g);
            return;
        }
        const int ridge = fit->best_ridge(g);
        store(result, set, fit->estimator(ridge), g, se, bias);
        result.ridge[set] = fit->ridges()[ridge];
        result.relative_error[set] = relative(fit->held_out_errors(g, ridge).squaredNorm(), g.squaredNorm());
    });
    if (has_twins) measure_isotropy(table, weight, static_cast<Eigen::Index>(n), result);
}

}  // namespace

size_t HarmonicProjection::n_coefficients() const {
    const auto n = static_cast<size_t>(harmonic_count(plan.order));
    if (plan.form == Form::per_light) return n;
    return plan.form == Form::matrix ? n * n
                                     : static_cast<size_t>(joint_basis_size(plan.order, plan.isotropic));
}

long long least_samples(const ProjectionPlan& plan) {
    return plan.form == Form::joint ? joint_basis_size(plan.order, plan.isotropic)
                                    : harmonic_count(plan.order);
}

void check_projection(const ProjectionPlan& plan) {
    if (plan.order < 1 || plan.order > max_harmonic_order)
        throw Error(ErrorCode::invalid_input, "order", std::to_string(plan.order),
                    "must be from 1 to " + std::to_string(max_harmonic_order));
    if (plan.form == Form::joint && least_samples(plan) > max_unknowns)
        throw Error(ErrorCode::limit, "order", std::to_string(plan.order),
                    std::to_string(least_samples(plan)) + " unknowns of a joint fit; at most " +
                        std::to_string(max_unknowns));
}

HarmonicProjection project(const Table& table, const ProjectionPlan& plan) {
    check_projection(plan);
    HarmonicProjection result;
    result.plan = plan;
    if (plan.form == Form::per_light) result.incident = table.incident;
    result.channels = table.channels;
    result.orders = table.orders;
    result.provenance = table.provenance;
    const size_t n_sets = result.channels.size() * result.slices() * result.n_sets();
    for (auto* values : {&result.coefficients, &result.se, &result.bias})
        values->resize(n_sets * result.n_coefficients());
    result.relative_error.resize(n_sets);
    result.ridge.resize(n_sets);

    VectorXd weight(table.rows());
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        weight[static_cast<Eigen::Index>(row)] = weight_of(plan, table.incident[i], table.outgoing[o]);
    }
    double noise = 0, total = 0;
    for_each_slice(table, weight, [&](size_t, size_t slice, const Samples& samples) {
        if (slice > 0) return;
        noise += samples.se.squaredNorm();
        total += samples.g.squaredNorm();
    });
    result.sample_noise = relative(noise, total);
    if (plan.form == Form::per_light)
        project_per_light(table, weight, result);
    else if (plan.form == Form::matrix)
        project_matrix(table, weight, result);
    else
        project_joint(table, weight, result);
    return result;
}

Table reconstruct(const HarmonicProjection& projection, const std::vector<AnglesDeg>& incident,
                  const std::vector<AnglesDeg>& outgoing) {
    const ProjectionPlan& plan = projection.plan;
    Table table;
    table.incident = incident;
    table.outgoing = outgoing;
    table.channels = projection.channels;
    table.orders = projection.orders;
    table.provenance = projection.provenance;
    for (auto* values : {&table.f, &table.se, &table.bias})
        values->resize(table.channels.size() * table.slices() * table.rows());

    const MatrixXd y_o = harmonics_of(plan, outgoing);
    // Lights as combinations of the sets or of the rows of C that are stored.
    MatrixXd lights;
    if (plan.form == Form::per_light) {
        lights = MatrixXd::Zero(incident.size(), projection.incident.size());
        for (size_t i = 0; i < incident.size(); ++i)
            lights(static_cast<Eigen::Index>(i),
                   static_cast<Eigen::Index>(light_index(projection, incident[i]))) = 1;
    } else {
        lights = harmonics_of(plan, incident);
    }
    const auto functions =
        plan.form == Form::joint ? joint_basis(plan.order, plan.isotropic) : std::vector<JointFunction>();
    const auto matrix_of = [&](const std::vector<double>& values, size_t channel, size_t slice) -> MatrixXd {
        const double* first = &values[projection.set_index(channel, slice, 0) * projection.n_coefficients()];
        if (plan.form == Form::joint)
            return joint_to_matrix(
                functions, Eigen::Map<const VectorXd>(first, static_cast<Eigen::Index>(functions.size())),
                plan.order);
        return Eigen::Map<const RowMajor>(first, lights.cols(), y_o.cols());
    };
    for (size_t channel = 0; channel < table.channels.size(); ++channel)
        for (size_t slice = 0; slice < table.slices(); ++slice) {
            const MatrixXd f = lights * matrix_of(projection.coefficients, channel, slice) * y_o.transpose();
            const MatrixXd variance = lights.cwiseAbs2() *
                                      matrix_of(projection.se, channel, slice).cwiseAbs2() *
                                      y_o.cwiseAbs2().transpose();
            const MatrixXd bias = lights.cwiseAbs() * matrix_of(projection.bias, channel, slice).cwiseAbs() *
                                  y_o.cwiseAbs().transpose();
            for (size_t row = 0; row < table.rows(); ++row) {
                const auto [i, o] = table.pair(row);
                const double weight = weight_of(plan, incident[i], outgoing[o]);
                const size_t k = table.index(channel, slice, row);
                table.f[k] = static_cast<float>(f(i, o) / weight);
                table.se[k] = static_cast<float>(std::sqrt(variance(i, o)) / weight);
                table.bias[k] = static_cast<float>(bias(i, o) / weight);
            }
        }
    return table;
}

}  // namespace gonio
