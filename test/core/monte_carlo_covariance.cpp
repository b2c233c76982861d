#include "core/monte_carlo_covariance.h"

#include <cmath>

namespace sckf {

::testing::AssertionResult covariancesAgree(const Eigen::MatrixXd& claimed, const Eigen::MatrixXd& sampled) {
  constexpr double kTolerance = 0.05;
  constexpr double kSmall = 0.3;
  for (Eigen::Index i = 0; i < claimed.rows(); ++i) {
    for (Eigen::Index j = 0; j < claimed.cols(); ++j) {
      const double scale = std::sqrt(sampled(i, i) * sampled(j, j));
      const double size = std::abs(sampled(i, j)) < kSmall * scale ? scale : std::abs(sampled(i, j));
      if (!(std::abs(claimed(i, j) - sampled(i, j)) <= kTolerance * size)) {
        return ::testing::AssertionFailure() << "entry (" << i << ", " << j << ")\nclaimed:\n"
                                             << claimed << "\nsampled:\n"
                                             << sampled;
      }
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace sckf
