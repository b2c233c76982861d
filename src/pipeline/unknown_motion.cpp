#include "sckf_odometry/pipeline/unknown_motion.h"

#include <algorithm>
#include <cmath>

namespace sckf {

namespace {

/// The variance after t of what drifts at a rate of variance 1 that it keeps for `memory`.
double drift(double t, double memory) { return t <= memory ? t * t : memory * (2.0 * t - memory); }

}  // namespace

bool isPossible(const SE2& motion, double dt, const MotionLimits& limits) {
  return motion.translation().norm() <= limits.max_speed * dt + limits.slack_translation &&
         std::abs(motion.yaw) <= limits.max_yaw_rate * dt + limits.slack_yaw;
}

bool isPossible(const Eigen::Vector3d& velocity, const MotionLimits& limits) {
  return velocity.head<2>().norm() <= limits.max_speed && std::abs(velocity.z()) <= limits.max_yaw_rate;
}

OdometryIncrement guessedIncrement(const MotionGuess& guess, Stamp from, Stamp to, double memory,
                                   const MotionLimits& limits) {
  const double begin = seconds(from - guess.since);
  const double end = seconds(to - guess.since);
  const Eigen::Vector3d way = guess.velocity * (std::min(end, memory) - std::min(begin, memory));
  const Eigen::Vector2d chord = SE2(0.0, 0.0, 0.5 * way.z()) * Eigen::Vector2d(way.head<2>());
  const Eigen::Vector3d std(limits.unknown_speed_std, limits.unknown_speed_std, limits.unknown_yaw_rate_std);
  const Eigen::Vector3d variance = std.cwiseAbs2() * (drift(end, memory) - drift(begin, memory));
  return {SE2(chord.x(), chord.y(), way.z()), variance.asDiagonal().toDenseMatrix()};
}

}  // namespace sckf
