// The functions of two directions that a reflectance with symmetries is made of.
#pragma once
#include <Eigen/Dense>
#include <vector>

namespace gonio {

// sum over terms of weight * y_incident(wi) * y_outgoing(wo), y being SH or HSH. Every function is
// normalised: orthonormal over pairs of directions.
struct JointFunction {
    struct Term {
        int incident, outgoing;  // harmonic_index
        double weight;
    };
    // What it is called: bands and m of its first term. Isotropic functions have m_i == m_o = m >= 0.
    int l_i = 0, m_i = 0, l_o = 0, m_o = 0;
    std::vector<Term> terms;
};

// Reciprocal functions of all bands below `order`, and of them only those that turns around z and mirrors do
// not change, if `isotropic`: y_lm(wi) y_km(wo) + y_l-m(wi) y_k-m(wo), which depends on phi_i - phi_o by cos
// m (phi_i - phi_o). Order 8: 120 functions (2080 without isotropy); in general n (n + 1) (n + 2) / 6 and n^2
// (n^2 + 1) / 2.
std::vector<JointFunction> joint_basis(int order, bool isotropic);
long long joint_basis_size(int order, bool isotropic);

// A row a pair: incident and outgoing hold the harmonics of each pair's directions, a row a pair.
Eigen::MatrixXd joint_design(const std::vector<JointFunction>& functions, const Eigen::MatrixXd& incident,
                             const Eigen::MatrixXd& outgoing);

// <p, q> over pairs of directions of a part of the sphere on which the harmonics have the Gram matrix `gram`.
Eigen::MatrixXd joint_gram(const std::vector<JointFunction>& functions, const Eigen::MatrixXd& gram);

// C_ab of sum_q coefficient_q function_q.
Eigen::MatrixXd joint_to_matrix(const std::vector<JointFunction>& functions,
                                const Eigen::VectorXd& coefficients, int order);

}  // namespace gonio
