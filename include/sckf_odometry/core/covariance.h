// What every covariance must be.
#pragma once

#include <Eigen/Core>

namespace sckf {

/// Whether a matrix is finite, symmetric and positive semi-definite, to rounding. Zero is.
bool isCovariance(const Eigen::Matrix3d& P);

/// The symmetric part: rounding must not make a covariance drift from symmetry.
template <typename Derived>
typename Derived::PlainObject symmetric(const Eigen::MatrixBase<Derived>& P) {
  const typename Derived::PlainObject value = P;
  return 0.5 * (value + value.transpose());
}

}  // namespace sckf
