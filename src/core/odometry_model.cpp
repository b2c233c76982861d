#include "sckf_odometry/core/odometry_model.h"

#include <cmath>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

OdometryIncrement modelledIncrement(const SE2& before_from_after, const OdometryNoise& noise) {
  const auto square = [](double v) { return v * v; };
  const double way = before_from_after.translation().norm();
  const double rotation = std::abs(before_from_after.yaw);
  const double translation_variance =
      square(noise.translation_per_meter) * way + square(noise.translation_per_radian) * rotation;
  const double yaw_variance = square(noise.yaw_per_meter) * way + square(noise.yaw_per_radian) * rotation;
  return {before_from_after,
          Eigen::Vector3d(translation_variance, translation_variance, yaw_variance).asDiagonal().toDenseMatrix()};
}

OdometryIncrement statedIncrement(const SE2& before_from_after, const Eigen::Matrix3d& twist_covariance, double dt) {
  return {before_from_after, twist_covariance * dt * dt};
}

bool sensibleTwistCovariance(const Eigen::Matrix3d& twist_covariance) {
  constexpr double kUnknown = 1e3;  // drivers write 1e3, 1e6, 1e9 for what they do not measure
  const double scale = twist_covariance.cwiseAbs().maxCoeff();
  return isCovariance(twist_covariance) && scale > 0.0 && scale < kUnknown;
}

}  // namespace sckf
