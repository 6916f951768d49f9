// Linear least squares with a ridge that the data choose themselves.
#pragma once
#include <Eigen/Dense>
#include <vector>

namespace gonio {

// Minimises |A c - g|^2 + c^T P c + ridge |c|^2 for many g at once. P stands for what is known without
// measuring (SH are zero below the horizon) and may be empty. The ridge is the one of `ridges()` whose
// leave-one-out error is least: the error of each sample against the fit to all others, which for linear fits
// needs no refitting, (g - fit) / (1 - leverage) (Allen's PRESS 1974; Golub, Heath & Wahba 1979).
class RidgeFit {
  public:
    // design A: a row a sample, a column an unknown; at least as many rows as unknowns for an honest error.
    RidgeFit(const Eigen::MatrixXd& design, const Eigen::MatrixXd& penalty);

    // Ratio of the largest and least singular value of A (with P, of what stands for both), before any ridge.
    double condition_number() const { return condition_number_; }
    const std::vector<double>& ridges() const { return ridges_; }

    // Index of the best ridge for the columns of g together.
    int best_ridge(const Eigen::MatrixXd& g) const;
    // c = estimator * g.
    const Eigen::MatrixXd& estimator(int ridge) const;
    // Row i, applied to g: what the fit to all samples but i says at sample i. Its diagonal is zero.
    Eigen::MatrixXd leave_one_out(int ridge) const;
    // The same minus g itself, for every column: the held-out errors.
    Eigen::MatrixXd held_out_errors(const Eigen::MatrixXd& g, int ridge) const;

  private:
    Eigen::VectorXd shrinkage(int ridge) const;
    Eigen::MatrixXd vectors_;  // eigenvectors of A^T A + P
    Eigen::VectorXd values_;   // and eigenvalues
    Eigen::MatrixXd turned_;   // A times the eigenvectors
    double condition_number_ = 0;
    std::vector<double> ridges_;
    mutable std::vector<Eigen::MatrixXd> estimators_;  // as they are asked for
};

}  // namespace gonio
