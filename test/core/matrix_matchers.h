// Matrices in GoogleTest: comparisons that print both sides, and derivatives to compare Jacobians with.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// Whether a and b have one shape and differ by at most `tolerance` in every entry. NaN differs from everything.
::testing::AssertionResult matricesNear(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double tolerance);

/// As matricesNear(), with the tolerance relative to the largest entry of the two.
::testing::AssertionResult matricesClose(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double relative_tolerance);

/// Of a symmetric matrix: not negative where that is a covariance.
double smallestEigenvalue(const Eigen::MatrixXd& symmetric);

/// Derivative of f: SE2 → SE2 at x by central differences, both sides in the additive error of se2.h.
template <typename Function>
Eigen::Matrix3d numericalJacobian(const Function& f, const SE2& x) {
  constexpr double kStep = 1e-5;  // truncation ~ step², rounding ~ 1e-16 / step: both near 1e-10
  Eigen::Matrix3d J;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d e = kStep * Eigen::Vector3d::Unit(i);
    J.col(i) = error(f(corrected(x, e)), f(corrected(x, -e))) / (2.0 * kStep);
  }
  return J;
}

}  // namespace sckf
