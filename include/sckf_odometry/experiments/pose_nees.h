// How large the error of a simulated robot's pose is, measured by its covariance.
#pragma once

#include <Eigen/Cholesky>

#include "sckf_odometry/core/world_error.h"

namespace sckf {

/// Normalised estimation error squared of a pose, χ² with three degrees of freedom. The error is taken as the ξ of the
/// world: a yaw known to 0.1 rad bends what is known of a place 10 m from the start into an arc, no ellipse in x and y.
/// covariance: of the additive error.
inline double poseNees(const SE2& truth, const SE2& estimate, const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix3d T_inverse = world_error::inverseOfAdditive(estimate);
  const Eigen::Matrix3d P = T_inverse * covariance * T_inverse.transpose();
  const Eigen::Vector3d xi = world_error::logarithm(compose(truth, inverse(estimate)));
  return xi.dot(P.llt().solve(xi));
}

}  // namespace sckf
