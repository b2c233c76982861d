// Whether a covariance is that of errors that were drawn.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

namespace sckf {

constexpr int kDraws = 100000;

/// Every entry within 5 %. An entry that is small against the geometric mean of its two variances is compared with
/// that: of kDraws draws it is not known better than to 0.3 % of it.
template <typename A, typename B>
::testing::AssertionResult covariancesAgree(const Eigen::MatrixBase<A>& claimed, const Eigen::MatrixBase<B>& sampled) {
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
