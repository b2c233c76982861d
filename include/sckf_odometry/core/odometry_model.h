// How far a motion reported by the wheels may be from the motion that was made.
#pragma once

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// Noise of wheel odometry that grows with the way and with the rotation, like a random walk: the variance of a motion
/// is the sum of the variances of its parts, however finely odometry is sampled. Ranges: all finite and ≥ 0.
struct OdometryNoise {
  double translation_per_meter = 0.10;   ///< std of x and y after 1 m of way [m/√m]
  double translation_per_radian = 0.08;  ///< std of x and y after 1 rad of rotation [m/√rad]
  double yaw_per_meter = 0.10;           ///< std of yaw after 1 m of way [rad/√m]
  double yaw_per_radian = 0.15;          ///< std of yaw after 1 rad of rotation [rad/√rad]
};

/// The increment with the covariance that the model gives it, 3 × 3 in base_link before the motion.
OdometryIncrement modelledIncrement(const SE2& before_from_after, const OdometryNoise& noise);

/// The increment with the covariance that the robot's driver states for its twist (3 × 3: vx, vy, yaw rate), held over
/// dt [s]: Q = Σ dt². Σ must be symmetric, positive definite on the diagonal and finite; see sensibleTwistCovariance().
OdometryIncrement statedIncrement(const SE2& before_from_after, const Eigen::Matrix3d& twist_covariance, double dt);

/// Whether a stated twist covariance can be used: finite, symmetric, positive semi-definite, not zero, and smaller than
/// the "unknown" values (≥ 1e3) that drivers put there.
bool sensibleTwistCovariance(const Eigen::Matrix3d& twist_covariance);

}  // namespace sckf
