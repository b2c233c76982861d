// What every covariance must be.
#pragma once

#include <Eigen/Core>

namespace sckf {

/// Whether a matrix is finite, symmetric and positive semi-definite, to rounding. Zero is.
bool isCovariance(const Eigen::Matrix3d& P);

}  // namespace sckf
