#include "fitting/ridge_fit.h"

#include <cmath>
#include <limits>

namespace gonio {

RidgeFit::RidgeFit(const Eigen::MatrixXd& design, const Eigen::MatrixXd& penalty) {
    Eigen::MatrixXd normal = design.transpose() * design;
    if (penalty.size() > 0) normal += penalty;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(normal);
    vectors_ = solver.eigenvectors();
    values_ = solver.eigenvalues().cwiseMax(0.0);
    turned_ = design * vectors_;
    const double largest = values_.maxCoeff(), least = values_.minCoeff();
    condition_number_ =
        std::sqrt(largest / std::max(least, largest * std::numeric_limits<double>::epsilon()));
    // As shares of the mean eigenvalue. The smallest only keeps rounding at bay.
    for (const double share : {1e-12, 1e-8, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1})
        ridges_.push_back(share * values_.mean());
    estimators_.resize(ridges_.size());
}

Eigen::VectorXd RidgeFit::shrinkage(int ridge) const {
    return (values_.array() + ridges_[ridge]).inverse();
}

const Eigen::MatrixXd& RidgeFit::estimator(int ridge) const {
    Eigen::MatrixXd& estimator = estimators_[ridge];
    if (estimator.size() == 0) estimator = vectors_ * shrinkage(ridge).asDiagonal() * turned_.transpose();
    return estimator;
}

Eigen::MatrixXd RidgeFit::held_out_errors(const Eigen::MatrixXd& g, int ridge) const {
    const Eigen::VectorXd inverse = shrinkage(ridge);
    const Eigen::VectorXd leverage = turned_.cwiseAbs2() * inverse;
    const Eigen::MatrixXd residual = turned_ * (inverse.asDiagonal() * (turned_.transpose() * g)) - g;
    // A sample with leverage 1 is met by any fit: nothing is known about its error, least of all that it is
    // zero.
    return (1 - leverage.array()).cwiseMax(1e-9).inverse().matrix().asDiagonal() * residual;
}

Eigen::MatrixXd RidgeFit::leave_one_out(int ridge) const {
    const Eigen::VectorXd inverse = shrinkage(ridge);
    Eigen::MatrixXd hat = turned_ * inverse.asDiagonal() * turned_.transpose();
    for (Eigen::Index i = 0; i < hat.rows(); ++i) {
        const double left = std::max(1 - hat(i, i), 1e-9);
        hat(i, i) = 0;
        hat.row(i) /= left;
    }
    return hat;
}

int RidgeFit::best_ridge(const Eigen::MatrixXd& g) const {
    int best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < static_cast<int>(ridges_.size()); ++k) {
        const double error = held_out_errors(g, k).squaredNorm();
        if (error < least) least = error, best = k;
    }
    return best;
}

}  // namespace gonio
