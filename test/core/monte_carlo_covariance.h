// Whether a covariance is that of errors that were drawn.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>

namespace sckf {

constexpr int kDraws = 100000;

/// Every entry within 5 %. An entry that is small against the geometric mean of its two variances is compared with
/// that: of kDraws draws it is not known better than to 0.3 % of it.
::testing::AssertionResult covariancesAgree(const Eigen::MatrixXd& claimed, const Eigen::MatrixXd& sampled);

}  // namespace sckf
