#include "sckf_odometry/core/displacement.h"

namespace sckf {

Displacement::MatrixDD Displacement::covariance() const {
  return J_reference * variance_reference.asDiagonal() * J_reference.transpose() +
         J_current * variance_current.asDiagonal() * J_current.transpose() + matching_noise;
}

}  // namespace sckf
