#include "fitting/joint_basis.h"

#include <cmath>

#include "directions/spherical_harmonics.h"

namespace gonio {
namespace {

// Adds the term and, if it is another one, its reciprocal; then scales all to unit norm.
void close(JointFunction& function) {
    std::vector<JointFunction::Term> both;
    for (const auto& term : function.terms) {
        both.push_back(term);
        if (function.l_i != function.l_o || function.m_i != function.m_o)
            both.push_back({term.outgoing, term.incident, term.weight});
    }
    for (auto& term : both) term.weight = 1 / std::sqrt(static_cast<double>(both.size()));
    function.terms = std::move(both);
}

}  // namespace

std::vector<JointFunction> joint_basis(int order, bool isotropic) {
    std::vector<JointFunction> functions;
    if (isotropic) {
        for (int m = 0; m < order; ++m)
            for (int l = m; l < order; ++l)
                for (int k = l; k < order; ++k) {
                    JointFunction function{l, m, k, m, {{harmonic_index(l, m), harmonic_index(k, m), 1}}};
                    if (m > 0) function.terms.push_back({harmonic_index(l, -m), harmonic_index(k, -m), 1});
                    close(function);
                    functions.push_back(function);
                }
        return functions;
    }
    for (int l = 0; l < order; ++l)
        for (int m = -l; m <= l; ++m)
            for (int k = l; k < order; ++k)
                for (int n = k == l ? m : -k; n <= k; ++n) {
                    JointFunction function{l, m, k, n, {{harmonic_index(l, m), harmonic_index(k, n), 1}}};
                    close(function);
                    functions.push_back(function);
                }
    return functions;
}

long long joint_basis_size(int order, bool isotropic) {
    const long long n = order;
    return isotropic ? n * (n + 1) * (n + 2) / 6 : n * n * (n * n + 1) / 2;
}

Eigen::MatrixXd joint_design(const std::vector<JointFunction>& functions, const Eigen::MatrixXd& incident,
                             const Eigen::MatrixXd& outgoing) {
    Eigen::MatrixXd design(incident.rows(), static_cast<Eigen::Index>(functions.size()));
    for (size_t q = 0; q < functions.size(); ++q) {
        auto column = design.col(static_cast<Eigen::Index>(q));
        column.setZero();
        for (const auto& term : functions[q].terms)
            column += term.weight * incident.col(term.incident).cwiseProduct(outgoing.col(term.outgoing));
    }
    return design;
}

Eigen::MatrixXd joint_gram(const std::vector<JointFunction>& functions, const Eigen::MatrixXd& gram) {
    const auto n = static_cast<Eigen::Index>(functions.size());
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index p = 0; p < n; ++p)
        for (Eigen::Index q = 0; q < n; ++q)
            for (const auto& a : functions[p].terms)
                for (const auto& b : functions[q].terms)
                    result(p, q) +=
                        a.weight * b.weight * gram(a.incident, b.incident) * gram(a.outgoing, b.outgoing);
    return result;
}

Eigen::MatrixXd joint_to_matrix(const std::vector<JointFunction>& functions,
                                const Eigen::VectorXd& coefficients, int order) {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(harmonic_count(order), harmonic_count(order));
    for (size_t q = 0; q < functions.size(); ++q)
        for (const auto& term : functions[q].terms)
            matrix(term.incident, term.outgoing) += term.weight * coefficients[static_cast<Eigen::Index>(q)];
    return matrix;
}

}  // namespace gonio
