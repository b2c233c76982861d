#include "sckf_odometry/core/wheel_calibration.h"

#include <cmath>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

WheelCalibration::Jacobian WheelCalibration::jacobian(const SE2& told, double yaw) {
  Jacobian B = Jacobian::Zero();
  B.topLeftCorner<2, 1>() = told.translation();
  B.block<1, 2>(2, 1) << told.yaw, told.x;
  B.block<2, 1>(0, 3) << std::cos(told.yaw) - 1.0, std::sin(told.yaw);
  B.topRightCorner<2, 2>() = told.translation().norm() * SE2(0.0, 0.0, -yaw).rotation();
  return B;
}

WheelCalibration::Matrix WheelCalibration::turn(double yaw) {
  Matrix R = Matrix::Identity();
  R.bottomRightCorner<2, 2>() = SE2(0.0, 0.0, yaw).rotation();
  return R;
}

WheelCalibration WheelCalibration::turned(double yaw) const {
  const Matrix R = turn(yaw);
  return {R * error, symmetric(R * covariance * R.transpose())};
}

WheelCalibration WheelCalibration::turnedWithTheRobot(double yaw) const {
  WheelCalibration there = turned(yaw);
  const double apart = 2.0 * error.tail<2>().norm() * std::sin(0.5 * yaw);
  there.covariance.diagonal().tail<2>().array() += 0.5 * apart * apart;
  return there;
}

}  // namespace sckf
