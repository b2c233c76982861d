// What wheels cannot have done, and what is assumed of the robot where they tell nothing.
#pragma once

#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// The largest motion that wheels can make, and what is assumed of one that they don't tell.
struct MotionLimits {
  double max_speed = 5.0;             ///< [m/s]
  double max_yaw_rate = 6.0;          ///< [rad/s]
  double slack_translation = 0.5;     ///< [m] allowed beyond: drivers stamp in bursts
  double slack_yaw = 0.5;             ///< [rad] … and in yaw
  double unknown_speed_std = 0.5;     ///< [m/s] where wheels tell nothing: how wrong the velocity guessed may be …
  double unknown_yaw_rate_std = 0.7;  ///< [rad/s] … and the yaw rate
};

/// Whether wheels can have made a motion in dt [s].
bool isPossible(const SE2& motion, double dt, const MotionLimits& limits);
/// Whether a robot can have a velocity (vx, vy, yaw rate) [m/s, m/s, rad/s].
bool isPossible(const Eigen::Vector3d& velocity, const MotionLimits& limits);

/// A robot that nothing has measured since an instant, and the velocity that it had then.
struct MotionGuess {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< (vx, vy, yaw rate) in base_link [m/s, m/s, rad/s]
  Stamp since = Stamp::max();                          ///< at the latest the beginning of what it is a guess of
};

/// The motion between two instants, not before guess.since, of a robot that keeps its velocity for `memory` [s] and
/// stands then. The velocity is off by the std of the limits, for that time by the same: the std grows with time at
/// first, and with its root then; the sum over parts of an interval is that of the interval.
OdometryIncrement guessedIncrement(const MotionGuess& guess, Stamp from, Stamp to, double memory,
                                   const MotionLimits& limits);

}  // namespace sckf
