// The error state of the filter with several clones: displacements of the world, ξ = (ρ, θ), with X = exp(ξ) ⊕ X̂.
#pragma once

#include <Eigen/Core>

#include "sckf_odometry/core/se2.h"

namespace sckf::world_error {

/// T: the additive error X̃ = T ξ of a pose.
Eigen::Matrix3d additive(const SE2& pose);
Eigen::Matrix3d inverseOfAdditive(const SE2& pose);

/// ξ of a pose that is displaced with its world by d, by ξ before.
Eigen::Matrix3d adjoint(const SE2& d);

/// exp(ξ): the displacement that ξ makes along a circular arc. Without the arc, a correction of the yaw would not turn
/// a pose far from the origin about itself.
SE2 exponential(const Eigen::Vector3d& xi);

/// ξ with exp(ξ) = d.
Eigen::Vector3d logarithm(const SE2& d);

}  // namespace sckf::world_error
