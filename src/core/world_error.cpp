#include "sckf_odometry/core/world_error.h"

#include <cmath>

namespace sckf::world_error {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Length of a chord over that of its arc of 2 half radians.
double chord(double half) { return std::abs(half) < 1e-9 ? 1.0 : std::sin(half) / half; }

}  // namespace

Matrix3d additive(const SE2& pose) {
  Matrix3d T = Matrix3d::Identity();
  T.topRightCorner<2, 1>() = quarterTurn(pose.translation());
  return T;
}

Matrix3d inverseOfAdditive(const SE2& pose) { return additive(SE2(-pose.x, -pose.y, 0.0)); }

Matrix3d adjoint(const SE2& d) {
  Matrix3d Ad = Matrix3d::Identity();
  Ad.topLeftCorner<2, 2>() = d.rotation();
  Ad.topRightCorner<2, 1>() = -quarterTurn(d.translation());
  return Ad;
}

SE2 exponential(const Vector3d& xi) {
  const double half = 0.5 * xi.z();
  const Eigen::Vector2d t = chord(half) * (SE2(0.0, 0.0, half).rotation() * xi.head<2>());
  return {t.x(), t.y(), xi.z()};
}

Vector3d logarithm(const SE2& d) {
  const double yaw = wrapAngle(d.yaw);
  Vector3d xi;
  xi << SE2(0.0, 0.0, -0.5 * yaw).rotation() * d.translation() / chord(0.5 * yaw), yaw;
  return xi;
}

}  // namespace sckf::world_error
