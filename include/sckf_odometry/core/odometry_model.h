// How far a motion reported by the wheels may be from the motion that was made.
#pragma once

#include <string>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// Noise of wheel odometry that grows with the way and with the rotation, like a random walk: the variance of a motion
/// is the sum of the variances of its parts, however finely odometry is sampled. Ranges: all finite and ≥ 0.
///
/// How the errors of a way s (≥ 0) and a rotation θ hang together, with the numbers below named a, b, c, d, q in order:
/// - omnidirectional: wheels that slip in every direction. x and y have the variance a² s + b² |θ|, yaw c² s + d² |θ|,
///   and no correlation, however long the increment is.
/// - differential: the same is added ahead and in yaw, correlated as for two wheels 2 a / c apart that err each for
///   itself. To the left only the share q² of that ahead is added: the rest there comes of yaw, over the way.
/// - ackermann: a² s is added ahead, the share q² of it to the left. Yaw is the way times the curvature κ = θ / s that
/// is
///   steered: an error of the way is one of yaw too, κ times as large; c² s + d² |θ| comes to it. There is no turn
///   without way, and b has no effect: rotation in excess of s / 0.3 m, which no car makes, has a std of 1 rad/√rad.
///
/// For the last two Q = ∫ G W Gᵀ along the arc that the motion is, where W is what is added at a point and
/// G = [C(φ) J (t_end − t); 0 1] carries it to the end. So it does not depend on how the arc is sliced.
struct OdometryNoise {
  double translation_per_meter = 0.05;    ///< std of x and y after 1 m of way [m/√m]
  double translation_per_radian = 0.04;   ///< std of x and y after 1 rad of rotation [m/√rad]
  double yaw_per_meter = 0.10;            ///< std of yaw after 1 m of way [rad/√m]
  double yaw_per_radian = 0.15;           ///< std of yaw after 1 rad of rotation [rad/√rad]
  double lateral_share = 0.2;             ///< q: std to the left over that ahead; of no effect where omnidirectional
  std::string model = "omnidirectional";  ///< one of odometryModelNames()
};

/// The names of models, the default first.
const std::vector<std::string>& odometryModelNames();

/// The increment with the covariance that the model gives it, 3 × 3 in base_link before the motion. Throws
/// std::invalid_argument with the names that there are if there is no model of that name.
OdometryIncrement modelledIncrement(const SE2& before_from_after, const OdometryNoise& noise);

/// The increment with the covariance that the robot's driver states for its twist (3 × 3: vx, vy, yaw rate). It is made
/// in dt [s], a part of the interval [s] in which the twist errs alike: Q = Σ dt interval, so that the parts of an
/// interval add up to Σ interval², however it is cut. Σ must be symmetric, positive definite on the diagonal and
/// finite; see sensibleTwistCovariance().
OdometryIncrement statedIncrement(const SE2& before_from_after, const Eigen::Matrix3d& twist_covariance, double dt,
                                  double interval);

/// Whether a stated twist covariance can be used: finite, symmetric, positive semi-definite, not zero, and smaller than
/// the "unknown" values (≥ 1e3) that drivers put there.
bool sensibleTwistCovariance(const Eigen::Matrix3d& twist_covariance);

}  // namespace sckf
