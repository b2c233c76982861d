// What wheel odometry errs by that stays the same.
#pragma once

#include <Eigen/Core>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// Systematic errors of the wheels, of the laser's place and by the floor: where the wheels tell (x, y, yaw), the true
/// motion is
///   (x (1 + s) − l (1 − cos yaw), y (1 + s) + l sin yaw, yaw (1 + r) + k x), and C(ψ)ᵀ f |(x, y)| besides:
/// one wheel is larger than the other, which turns the robot to the other side when it reverses; the laser is farther
/// ahead, by l, of the point about which they turn than its mount says; a floor, as a carpet by its pile, takes the
/// robot along by f for each metre that it drives, whichever way it faces. ψ: yaw of base_link in the world, before.
struct WheelCalibration {
  static constexpr int kErrors = 6;
  using Vector = Eigen::Matrix<double, kErrors, 1>;
  using Matrix = Eigen::Matrix<double, kErrors, kErrors>;
  using Jacobian = Eigen::Matrix<double, 3, kErrors>;
  using Columns = Eigen::Matrix<double, kErrors, Eigen::Dynamic>;

  Vector error = Vector::Zero();       ///< s, r, k, l, f [1, 1, rad/m, m, m/m], f in x and y of the world
  Matrix covariance = Matrix::Zero();  ///< of what `error` errs by

  /// Of the true motion (x, y, yaw) by the errors, where the wheels tell this one. yaw: ψ [rad].
  static Jacobian jacobian(const SE2& told, double yaw);

  /// What `error` becomes where x and y of the world are taken for others, against which it is turned by yaw [rad].
  static Matrix turn(double yaw);
  WheelCalibration turned(double yaw) const;

  /// The same where the robot is told to face elsewhere by yaw, and nobody says whether the estimate had drifted by so
  /// much, so that the world is turned, or somebody has carried the robot, so that it is not: turned, less certain.
  WheelCalibration turnedWithTheRobot(double yaw) const;
};

}  // namespace sckf
