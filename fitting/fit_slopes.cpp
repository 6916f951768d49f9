// Maximum likelihood of Beckmann and GGX on slopes. With q = |A g|^2, A lower triangular, the density of
// slopes in d dimensions is
//   Beckmann  det A pi^(-d/2) exp(-q),     GGX  det A c_d (1 + q)^(-(2 + d) / 2),  c_2 = 1 / pi, c_1 = 1 / 2,
// d = 2 on a surface, d = 1 where all slopes lie on one line (grooves): there only the marginal along the
// line has a density.
//
// Fisher information: for ln alpha of Beckmann 4 n (isotropic) and 2 n an axis, rotation n (l1 - l2)^2 / (l1
// l2) with l = alpha^2; for the Student t it falls to 4/3 n, the covariance of (ln alpha_x, ln alpha_y) is
// [1.125 0.375; 0.375 1.125] / n, and the rotation's information falls by 2/3 (Lange, Little, Taylor 1989,
// "Robust statistical modeling using the t distribution", app. B). In one dimension 2 n and 0.8 n.
#include "fitting/fit_slopes.h"

#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>

namespace gonio {
namespace {

// Mean negative log-likelihood without its constant, and its gradient in (a, b, c), A = [e^a 0; b e^c];
// isotropic: a alone. Exponentials, so that no step can leave the domain (clamping would stall the solver at
// the edge).
class NegativeLogLikelihood final : public ceres::FirstOrderFunction {
  public:
    NegativeLogLikelihood(const std::vector<SlopeCell>& cells, NdfModel model, int n_parameters,
                          int dimension)
        : cells_(cells), model_(model), n_parameters_(n_parameters), dimension_(dimension) {
        for (const SlopeCell& cell : cells) total_ += cell.count;
    }
    int NumParameters() const override { return n_parameters_; }

    bool Evaluate(const double* x, double* cost, double* gradient) const override {
        const bool is_full = n_parameters_ == 3;
        const double ea = std::exp(x[0]), b = is_full ? x[1] : 0, ec = is_full ? std::exp(x[2]) : ea;
        const double power = (2 + dimension_) / 2.0;
        double sum = 0, xx = 0, xy = 0, yy = 0;  // sums of w dq, w = dcost / dq
        for (const SlopeCell& cell : cells_) {
            const double q = ea * ea * cell.xx + b * b * cell.xx + 2 * b * ec * cell.xy + ec * ec * cell.yy;
            const double w = model_ == NdfModel::beckmann ? cell.count : cell.count * power / (1 + q);
            sum += model_ == NdfModel::beckmann ? cell.count * q : cell.count * power * std::log1p(q);
            xx += w * cell.xx, xy += w * cell.xy, yy += w * cell.yy;
        }
        // log det A: a in one dimension, 2 a isotropic, a + c in general.
        const double log_det = is_full ? x[0] + x[2] : dimension_ * x[0];
        *cost = sum / total_ - log_det;
        if (gradient && is_full) {
            gradient[0] = 2 * ea * ea * xx / total_ - 1;
            gradient[1] = (2 * b * xx + 2 * ec * xy) / total_;
            gradient[2] = (2 * b * ec * xy + 2 * ec * ec * yy) / total_ - 1;
        } else if (gradient) {
            gradient[0] = 2 * ea * ea * (xx + yy) / total_ - dimension_;
        }
        return std::isfinite(*cost);
    }

  private:
    const std::vector<SlopeCell>& cells_;
    NdfModel model_;
    int n_parameters_, dimension_;
    double total_ = 0;
};

SlopeCell mean_of(const std::vector<SlopeCell>& cells) {
    SlopeCell mean;
    for (const SlopeCell& cell : cells) {
        mean.count += cell.count;
        mean.xx += cell.count * cell.xx, mean.xy += cell.count * cell.xy, mean.yy += cell.count * cell.yy;
    }
    mean.xx /= mean.count, mean.xy /= mean.count, mean.yy /= mean.count;
    return mean;
}

// Turns the axis by quarter turns until it is the one nearest to +x; true if the axes have changed places.
bool nearest_to_x(double& rotation) {
    bool is_swapped = false;
    for (; rotation > pi / 4; is_swapped = !is_swapped) rotation -= pi / 2;
    for (; rotation <= -pi / 4; is_swapped = !is_swapped) rotation += pi / 2;
    return is_swapped;
}

// alpha_x, alpha_y and rotation of the quadratic form q = |A g|^2.
void set_axes(NdfFit& fit, double a, double b, double c) {
    const double ea = std::exp(a), ec = std::exp(c), xx = ea * ea + b * b, xy = b * ec, yy = ec * ec;
    const double larger = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy);
    const double smaller =
        std::exp(2 * (a + c)) / larger;  // from the determinant: the difference would cancel
    double rotation =
        0.5 * std::atan2(2 * xy, xx - yy);  // the axis of the larger eigenvalue, that is of the smaller alpha
    const bool is_swapped = nearest_to_x(rotation);
    fit.alpha_x = 1 / std::sqrt(is_swapped ? smaller : larger);
    fit.alpha_y = 1 / std::sqrt(is_swapped ? larger : smaller);
    fit.rotation_deg = degrees(rotation);
}

void set_standard_errors(NdfFit& fit, int dimension, const EffectiveSize& n) {
    const bool is_ggx = fit.model == NdfModel::ggx;
    if (fit.isotropic) {
        fit.se_alpha = fit.alpha * std::sqrt((is_ggx ? 0.75 : 0.25) / n.alpha);
        fit.se_alpha_x = fit.se_alpha_y = fit.se_alpha;
        return;
    }
    const double axis = dimension == 1 ? (is_ggx ? 1.25 : 0.5) : (is_ggx ? 1.125 : 0.5);
    const double rel_x = std::sqrt(axis / n.alpha_x), rel_y = std::sqrt(axis / n.alpha_y);
    fit.se_alpha_x = fit.alpha_x * rel_x;
    fit.se_alpha_y = fit.alpha_y * rel_y;
    if (dimension == 1) return;
    fit.se_alpha =
        0.5 * fit.alpha * std::sqrt(rel_x * rel_x + rel_y * rel_y + (is_ggx ? 2 / 3.0 * rel_x * rel_y : 0));
    // An axis known to nobody is uniform over a quarter turn.
    const double l1 = fit.alpha_x * fit.alpha_x, l2 = fit.alpha_y * fit.alpha_y;
    const double se_rotation = std::sqrt(l1 * l2 * (is_ggx ? 1.5 : 1) / n.rotation) / std::abs(l1 - l2);
    fit.se_rotation_deg = std::min(degrees(se_rotation), 90 / std::sqrt(12.0));
}

// `cells` are scaled to slopes of order one; `scale` undoes it.
NdfFit fit_model(const std::vector<SlopeCell>& cells, const SlopeCell& mean, NdfModel model, bool isotropic,
                 int dimension, double scale, const EffectiveSize& n_effective) {
    NdfFit fit{.model = model, .isotropic = isotropic};
    const bool is_full = !isotropic && dimension == 2;
    // Start: Beckmann's closed form, A^T A = (2 C)^-1 (isotropic: 1 / alpha^2 = 1 / trace C; one dimension: 1
    // / (2 C)).
    std::vector<double> x{-0.5 * std::log((isotropic ? 1 : 2) * (mean.xx + mean.yy))};
    if (is_full) {
        const double c = -0.5 * std::log(2 * (mean.yy - mean.xy * mean.xy / mean.xx));
        x = {-0.5 * std::log(2 * mean.xx), -mean.xy / mean.xx * std::exp(c), c};
        // (lower triangular: the second row is the residual of y on x)
    }
    ceres::GradientProblem problem(
        new NegativeLogLikelihood(cells, model, static_cast<int>(x.size()), isotropic ? 2 : dimension));
    ceres::GradientProblemSolver::Options options;
    options.logging_type = ceres::SILENT;
    // Bisection, because interpolation by polynomials logs a warning a step where a likelihood runs away.
    options.line_search_interpolation_type = ceres::BISECTION;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-14;
    options.gradient_tolerance = 1e-9;
    options.parameter_tolerance = 1e-10;
    ceres::GradientProblemSolver::Summary summary;
    ceres::Solve(options, problem, x.data(), &summary);

    if (is_full) {
        set_axes(fit, x[0], x[1], x[2]);
    } else {
        fit.alpha_x = fit.alpha_y = std::exp(-x[0]);
        if (!isotropic) {  // all slopes on one line
            fit.rotation_deg = degrees(principal_rotation(mean));
            const bool along_x = mean.xx >= mean.yy;
            (along_x ? fit.alpha_y : fit.alpha_x) = 0;
        }
    }
    // A likelihood without a maximum runs away to a spike: half of the facets level, or three quarters on one
    // line.
    const double smallest =
        dimension == 1 ? std::max(fit.alpha_x, fit.alpha_y) : std::min(fit.alpha_x, fit.alpha_y);
    if (!(smallest > 1e-6)) {
        return {.model = model,
                .isotropic = isotropic,
                .message = "the likelihood has no maximum: too many facets share one slope"};
    }
    fit.alpha_x *= scale;
    fit.alpha_y *= scale;
    fit.alpha = dimension == 1 && !isotropic ? std::max(fit.alpha_x, fit.alpha_y)
                                             : std::sqrt(fit.alpha_x * fit.alpha_y);
    const double log_norm = dimension == 2 || isotropic   ? -std::log(pi)
                            : model == NdfModel::beckmann ? -0.5 * std::log(pi)
                                                          : -std::log(2.0);
    const int d = isotropic ? 2 : dimension;
    fit.log_likelihood = n_effective.alpha * (-summary.final_cost + log_norm - d * std::log(scale));
    fit.aic = 2 * static_cast<double>(x.size()) - 2 * fit.log_likelihood;
    set_standard_errors(fit, dimension, n_effective);
    if (dimension == 1 && !isotropic) fit.se_alpha = std::max(fit.se_alpha_x, fit.se_alpha_y);
    fit.converged = summary.termination_type == ceres::CONVERGENCE;
    fit.message = !fit.converged ? "not converged: " + summary.message
                  : dimension == 1 && !isotropic
                      ? "all slopes lie along one axis: fitted to the marginal along it"
                      : "converged";
    return fit;
}

}  // namespace

double principal_rotation(const SlopeCell& moments) {
    double rotation = 0.5 * std::atan2(2 * moments.xy, moments.xx - moments.yy);
    nearest_to_x(rotation);
    return rotation;
}

std::vector<NdfFit> fit_slopes(const std::vector<SlopeCell>& cells, const EffectiveSize& n_effective) {
    SlopeCell mean = mean_of(cells);
    const double trace = mean.xx + mean.yy;
    std::vector<NdfFit> fits;
    if (!(trace > 0)) {
        for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx})
            for (const bool isotropic : {true, false})
                fits.push_back(
                    {.model = model,
                     .isotropic = isotropic,
                     .converged = true,
                     .message = "flat: every facet faces +z, so alpha is 0 and D a delta function"});
        return fits;
    }
    const double scale = std::sqrt(trace / 2);
    std::vector<SlopeCell> scaled = cells;
    for (SlopeCell& cell : scaled)
        cell.xx /= scale * scale, cell.xy /= scale * scale, cell.yy /= scale * scale;
    mean = mean_of(scaled);
    // Rounding of float heights leaves 1e-14 where grooves stand askew; a real second dimension is far above.
    const double smaller = (mean.xx * mean.yy - mean.xy * mean.xy) / (mean.xx + mean.yy);
    const int dimension = smaller > 1e-10 ? 2 : 1;
    for (const NdfModel model : {NdfModel::beckmann, NdfModel::ggx})
        for (const bool isotropic : {true, false})
            fits.push_back(fit_model(scaled, mean, model, isotropic, dimension, scale, n_effective));
    return fits;
}

}  // namespace gonio
