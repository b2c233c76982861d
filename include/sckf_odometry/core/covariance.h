// What every covariance must be, and every estimate of a pose.
#pragma once

#include <Eigen/Core>
#include <string>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// Whether a matrix is finite, symmetric and positive semi-definite, to rounding. Zero is.
bool isCovariance(const Eigen::Matrix3d& P);

/// Whether it is a covariance of which nothing is known exactly, so that it has an inverse.
bool isPositiveDefinite(const Eigen::Matrix3d& P);

/// The same, but for a yaw of which less is known than nothing: its std is a full turn then. What is far from the
/// origin would err by so much otherwise that doubles do not hold a centimetre beside it.
Eigen::Matrix3d withYawUpToATurn(const Eigen::Matrix3d& covariance);

/// What is wrong with a pose and its covariance as an estimate, what was expected; empty if nothing is.
std::string problemOf(const SE2& pose, const Eigen::Matrix3d& covariance);

/// eᵀ P⁻¹ e: χ² with as many degrees of freedom as e has rows, if P is its covariance. Infinite if P has no inverse or
/// something is no number, so that it exceeds every bound.
double normalisedSquare(const Eigen::VectorXd& e, const Eigen::MatrixXd& P);

/// J R Jᵀ, with the diagonal of R: what J (d × M, few rows) makes of independent errors.
Eigen::MatrixXd carriedOver(const Eigen::MatrixXd& J, const Eigen::VectorXd& variances);

/// The symmetric part: rounding must not make a covariance drift from symmetry.
template <typename Derived>
typename Derived::PlainObject symmetric(const Eigen::MatrixBase<Derived>& P) {
  const typename Derived::PlainObject value = P;
  return 0.5 * (value + value.transpose());
}

}  // namespace sckf
