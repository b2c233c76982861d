// Matrices in GoogleTest: comparisons that print both sides, and derivatives to compare Jacobians with.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// Whether a and b have one shape and differ by at most `tolerance` in every entry. NaN differs from everything.
template <typename A, typename B>
::testing::AssertionResult matricesNear(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b,
                                        double tolerance) {
  const bool same_shape = a.rows() == b.rows() && a.cols() == b.cols();
  if (same_shape && ((a - b).array().abs() <= tolerance).all()) return ::testing::AssertionSuccess();
  ::testing::AssertionResult failure = ::testing::AssertionFailure();
  failure << "left, " << a.rows() << " x " << a.cols() << ":\n" << a.derived() << "\n";
  failure << "right, " << b.rows() << " x " << b.cols() << ":\n" << b.derived() << "\n";
  if (same_shape) failure << "left - right, tolerance " << tolerance << ":\n" << (a - b).eval();
  return failure;
}

/// As matricesNear(), with the tolerance relative to the largest entry of the two.
template <typename A, typename B>
::testing::AssertionResult matricesClose(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b,
                                         double relative_tolerance) {
  const auto largest = [](const auto& m) { return m.size() == 0 ? 0.0 : m.array().abs().maxCoeff(); };
  return matricesNear(a, b, relative_tolerance * std::max(largest(a), largest(b)));
}

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
