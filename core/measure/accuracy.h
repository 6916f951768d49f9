// From independent randomised runs to values with honest standard errors.
#pragma once
#include <vector>

#include "measure/plan.h"

namespace gonio {

// Mean and spread of a vector of values over runs (Welford: no cancellation).
class Moments {
  public:
    void add(const std::vector<float>& values);
    int count() const { return count_; }
    const std::vector<double>& mean() const { return mean_; }
    // Variance of one run about the mean; count() >= 2.
    double variance(size_t i) const { return squares_[i] / (count_ - 1); }

  private:
    int count_ = 0;
    std::vector<double> mean_, squares_;
};

// How rows of a table share their directions: rows with the same light, or the same view, have related
// errors.
struct RowGroups {
    std::vector<int> light, view;  // per row
    int n_lights = 0, n_views = 0;
};

// Standard error (one sigma) of the mean of one slice of rows [first, first + groups.light.size()). With few
// runs the sample deviation is itself uncertain (with 4, one sigma covers 61 %, not 68 %), so each row's
// variance is drawn towards what its light and its view predict - relative variance of the row = row factor x
// column factor, both pooled over the table - which counts as further degrees of freedom, and what
// uncertainty is left scales the result by Student's t.
std::vector<double> standard_errors(const Moments& moments, size_t first, const RowGroups& groups);

// The denominator of relative errors: max(f, 0.01 mean f), per row.
std::vector<double> error_scale(const std::vector<double>& f);

// Student's t at 84.13 % (one sigma of a normal) over 1.
double student_one_sigma(double degrees_of_freedom);

}  // namespace gonio
